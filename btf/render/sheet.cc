#include "btf/render/sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"

namespace tessera {
namespace {

constexpr int kMostGap = 256;
constexpr int64_t kMostPixels = int64_t{1} << 28;

absl::Status CheckDirection(const char* name, const Direction& direction) {
  if (!std::isfinite(direction.phi_rad) || !(direction.theta_rad >= 0.0 && direction.theta_rad < 0.5 * kPi)) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": polar angle ", DegFromRad(direction.theta_rad),
                                                   ", azimuth ", DegFromRad(direction.phi_rad),
                                                   " degrees, expected a polar angle of 0 to below 90"));
  }
  return absl::OkStatus();
}

// Linear RGB of a seam's heat: piecewise linear between the colours that sheet.h names.
std::array<float, 3> ColourOfHeat(uint8_t heat) {
  constexpr int kNumStops = 4;
  constexpr std::array<float, kNumStops> kHeats = {64.0f, 80.0f, 96.0f, 128.0f};
  constexpr std::array<std::array<float, 3>, kNumStops> kColours = {
      {{0.03f, 0.1f, 0.9f}, {0.02f, 0.7f, 0.1f}, {0.9f, 0.8f, 0.02f}, {0.9f, 0.02f, 0.02f}}};
  const float value = std::clamp(static_cast<float>(heat), kHeats.front(), kHeats.back());
  int stop = 0;
  while (stop + 2 < kNumStops && value > kHeats[stop + 1]) {
    ++stop;
  }
  const float share = (value - kHeats[stop]) / (kHeats[stop + 1] - kHeats[stop]);
  std::array<float, 3> colour{};
  for (int channel = 0; channel < 3; ++channel) {
    colour[channel] = std::lerp(kColours[stop][channel], kColours[stop + 1][channel], share);
  }
  return colour;
}

// `rgb` under its seams.
std::array<float, 3> WithHeat(const float* rgb, uint8_t heat) {
  if (heat > 0) {
    return ColourOfHeat(heat);
  }
  constexpr float kDimmed = 0.3f;
  const float grey = kDimmed * (rgb[0] + rgb[1] + rgb[2]) / 3.0f;
  return {grey, grey, grey};
}

}  // namespace

absl::StatusOr<Image> RenderTileSheet(const TileSet& tile_set, const SheetParams& params,
                                      const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckDirection("light", params.light));
  TESSERA_RETURN_IF_ERROR(CheckDirection("view", params.view));
  if (params.gap < 0 || params.gap > kMostGap) {
    return absl::InvalidArgumentError(absl::StrCat("gap: ", params.gap, ", expected 0..", kMostGap));
  }
  const auto num_tiles = static_cast<int64_t>(tile_set.tile_codes.size());
  if (params.columns < 0 || params.columns > num_tiles) {
    return absl::InvalidArgumentError(
        absl::StrCat("columns: ", params.columns, ", expected 0 to the number of tiles, ", num_tiles));
  }
  const int64_t w = tile_set.tile_size;
  if (num_tiles < 1 || w < 1 || static_cast<int64_t>(tile_set.tile_index.size()) != num_tiles * w * w) {
    return absl::InvalidArgumentError(absl::StrCat("a tile set of ", num_tiles, " tiles of ", w,
                                                   " texels has ", tile_set.tile_index.size(), " texels"));
  }
  if (params.seam_heat && tile_set.seam_heat.size() != tile_set.tile_index.size()) {
    return absl::InvalidArgumentError("the tile set does not hold the heat of its seams: certify it again");
  }
  const int64_t columns = params.columns > 0
                              ? params.columns
                              : static_cast<int64_t>(std::ceil(std::sqrt(static_cast<double>(num_tiles))));
  const int64_t rows = (num_tiles + columns - 1) / columns;
  const int64_t pitch = w + params.gap;
  const int64_t heat_offset = columns * pitch;
  const int64_t width = (params.seam_heat ? 2 : 1) * columns * pitch + params.gap;
  const int64_t height = rows * pitch + params.gap;
  if (width * height > kMostPixels) {
    return absl::InvalidArgumentError(
        absl::StrCat("the sheet is ", width, "x", height, ", expected at most ", kMostPixels, " pixels"));
  }

  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(tile_set.btfels));
  const size_t num_btfels = tile_set.btfels.size();
  std::vector<bool> used(num_btfels * 4, false);
  for (size_t i = 0; i < tile_set.tile_index.size(); ++i) {
    const uint32_t texel = tile_set.tile_index[i];
    if (BtfelOfTexel(texel) >= num_btfels) {
      return absl::InvalidArgumentError(
          absl::StrCat("texel ", i, " names BTFel ", BtfelOfTexel(texel), " of ", num_btfels));
    }
    used[size_t{BtfelOfTexel(texel)} * 4 + TurnsOfTexel(texel)] = true;
  }
  const Eigen::Vector3d light = VectorFromDirection(params.light);
  const Eigen::Vector3d view = VectorFromDirection(params.view);
  std::vector<std::array<float, 3>> values(used.size());
  ParallelFor(context, 0, static_cast<int64_t>(num_btfels), 256, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      for (int turns = 0; turns < 4; ++turns) {
        if (used[i * 4 + turns]) {
          const Eigen::Array3d rgb = decoder->Decode(tile_set.btfels.btfel(i), light, view, turns);
          values[i * 4 + turns] = {static_cast<float>(rgb[0]), static_cast<float>(rgb[1]),
                                   static_cast<float>(rgb[2])};
        }
      }
    }
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());

  Image sheet(static_cast<int>(width), static_cast<int>(height), 4);
  for (int64_t tile = 0; tile < num_tiles; ++tile) {
    const int64_t left = params.gap + tile % columns * pitch;
    const int64_t top = params.gap + tile / columns * pitch;
    for (int y = 0; y < w; ++y) {
      for (int x = 0; x < w; ++x) {
        const uint32_t texel = tile_set.texel(static_cast<int>(tile), x, y);
        float* pixel = sheet.at(static_cast<int>(left) + x, static_cast<int>(top) + y);
        std::copy_n(values[size_t{BtfelOfTexel(texel)} * 4 + TurnsOfTexel(texel)].begin(), 3, pixel);
        pixel[3] = 1.0f;
        if (params.seam_heat) {
          float* const beside = sheet.at(static_cast<int>(heat_offset + left) + x, static_cast<int>(top) + y);
          std::ranges::copy(WithHeat(pixel, tile_set.seam_heat[(tile * w + y) * w + x]), beside);
          beside[3] = 1.0f;
        }
      }
    }
  }
  return sheet;
}

}  // namespace tessera
