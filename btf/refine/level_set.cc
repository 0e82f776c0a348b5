#include "btf/refine/level_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/codec/quantize.h"
#include "btf/math/conventions.h"
#include "btf/refine/scene_cases.h"
#include "btf/wang/scene_needs.h"

namespace tessera {
namespace {

// Patches go with the strip's height, and cells are to be smaller.
constexpr int kCellsPerStrip = 4;
constexpr size_t kErrorTexels = 256;
constexpr size_t kErrorPairs = 8;
constexpr size_t kBtfelsPerStop = 256;

// By how much the pixel moves where the texel moves by one across, or down, of the tile.
struct Way {
  int x = 0;
  int y = 0;
};
constexpr std::array<Way, 4> kAcross = {{{1, 0}, {0, 1}, {-1, 0}, {0, -1}}};  // by turns
constexpr std::array<Way, 4> kDown = {{{0, 1}, {-1, 0}, {0, -1}, {1, 0}}};

// A tile set seen in cells of side x side texels.
class Cells {
 public:
  Cells(const TileSet& tile_set, int width, int side)
      : tile_set_(tile_set),
        width_(width),
        height_(static_cast<int>(tile_set.source_pixels.back()) / width + 1),
        side_(side) {}

  // The first of the pixels that the cell covers in the patch that most of its texels show, and its turn.
  [[nodiscard]] uint32_t TexelOf(int tile, int cell_x, int cell_y) {
    patches_.clear();
    for (int y = 0; y < side_; ++y) {
      for (int x = 0; x < side_; ++x) {
        Count(PatchAt(tile, cell_x * side_ + x, cell_y * side_ + y));
      }
    }
    // The first of those that most show.
    const Patch& patch = std::ranges::max_element(patches_, {}, &std::pair<Patch, int>::second)->first;
    const Way across = kAcross[patch.turns];
    const Way down = kDown[patch.turns];
    const auto first = [&](int origin, int step_x, int step_y) {
      const int at = origin + side_ * (cell_x * step_x + cell_y * step_y);
      return at + (side_ - 1) * (std::min(step_x, 0) + std::min(step_y, 0));
    };
    // A patch may end at the exemplar's side within the cell.
    const int x = std::clamp(first(patch.x, across.x, down.x), 0, std::max(width_ - side_, 0));
    const int y = std::clamp(first(patch.y, across.y, down.y), 0, std::max(height_ - side_, 0));
    return PackTexel(static_cast<uint32_t>(y * width_ + x), patch.turns);
  }

  // The mean over the pixels from `first` on that the tile set has.
  void MeanOf(uint32_t first, std::span<float> mean) const {
    std::ranges::fill(mean, 0.0F);
    const BtfelTable& table = tile_set_.btfels;
    float count = 0.0F;
    const int left = static_cast<int>(first) % width_;
    const int top = static_cast<int>(first) / width_;
    for (int y = top; y < std::min(top + side_, height_); ++y) {
      const std::vector<uint32_t>& pixels = tile_set_.source_pixels;
      const auto end = static_cast<uint32_t>(y * width_ + std::min(left + side_, width_));
      for (auto pixel = std::ranges::lower_bound(pixels, static_cast<uint32_t>(y * width_ + left));
           pixel != pixels.end() && *pixel < end; ++pixel) {
        std::ranges::transform(table.btfel(static_cast<size_t>(pixel - pixels.begin())), mean, mean.begin(),
                               [](uint8_t code, float sum) { return sum + static_cast<float>(code); });
        count += 1.0F;
      }
    }
    for (size_t i = 0; i < mean.size(); ++i) {
      mean[i] = table.offset[i] + table.step[i] * (mean[i] / std::max(count, 1.0F));
    }
  }

 private:
  // Named by the pixel that it would show at texel (0, 0).
  struct Patch {
    int x = 0;
    int y = 0;
    int turns = 0;
    bool operator==(const Patch&) const = default;
  };

  [[nodiscard]] Patch PatchAt(int tile, int x, int y) const {
    const uint32_t texel = tile_set_.texel(tile, x, y);
    const auto pixel = static_cast<int>(tile_set_.source_pixels[BtfelOfTexel(texel)]);
    const int turns = TurnsOfTexel(texel);
    return {.x = pixel % width_ - x * kAcross[turns].x - y * kDown[turns].x,
            .y = pixel / width_ - x * kAcross[turns].y - y * kDown[turns].y,
            .turns = turns};
  }

  void Count(const Patch& patch) {
    const auto found = std::ranges::find(patches_, patch, &std::pair<Patch, int>::first);
    if (found == patches_.end()) {
      patches_.emplace_back(patch, 1);
    } else {
      ++found->second;
    }
  }

  const TileSet& tile_set_;
  int width_;
  int height_;  // of what the tile set shows
  int side_;
  std::vector<std::pair<Patch, int>> patches_;  // of a cell, with how many texels show them
};

// S of level_set.h, texels.
int CellSide(const TileSet& tile_set, int level) {
  int side = 1;
  while (side < (1 << (level - 1)) && side * 2 * kCellsPerStrip <= tile_set.strip_height) {
    side *= 2;
  }
  return side;
}

// Quantised, with a range of its own.
absl::Status QuantizeMeans(const Cells& cells, const RunContext& context, TileSet& far) {
  const auto k = static_cast<size_t>(far.btfels.num_coefficients);
  std::vector<float> low(k, INFINITY);
  std::vector<float> high(k, -INFINITY);
  std::vector<float> mean(k);
  const auto for_means = [&](const auto& body) {
    for (size_t i = 0; i < far.source_pixels.size(); ++i) {
      if (i % kBtfelsPerStop == 0) {
        TESSERA_RETURN_IF_ERROR(context.CheckStop());
      }
      cells.MeanOf(far.source_pixels[i], mean);
      body(i);
    }
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(for_means([&](size_t) {
    for (size_t c = 0; c < k; ++c) {
      low[c] = std::min(low[c], mean[c]);
      high[c] = std::max(high[c], mean[c]);
    }
  }));
  Quantisation quantisation = UniformQuantisation(low, high);
  std::vector<uint8_t> codes(far.source_pixels.size() * k);
  TESSERA_RETURN_IF_ERROR(
      for_means([&](size_t i) { Quantize(quantisation, mean, std::span(codes).subspan(i * k, k)); }));
  far.btfels.codes = CodeBuffer(std::move(codes));
  far.btfels.offset = std::move(quantisation.offset);
  far.btfels.step = std::move(quantisation.step);
  return absl::OkStatus();
}

// Squares of texels of side x side texels of a tile set, under one pair of light and view.
class Squares {
 public:
  explicit Squares(const TileSet& tile_set, const Decoder& decoder, int side)
      : tile_set_(tile_set), decoder_(decoder), side_(side) {}

  // The mean over the square's texels, by turns: coefficients times the share of the texels.
  void Add(int tile, int square_x, int square_y) {
    const BtfelTable& table = tile_set_.btfels;
    const auto k = static_cast<size_t>(table.num_coefficients);
    sums_.emplace_back();
    std::array<std::vector<double>, 4>& sums = sums_.back();
    const double share = 1.0 / (static_cast<double>(side_) * side_);
    for (int y = 0; y < side_; ++y) {
      for (int x = 0; x < side_; ++x) {
        const uint32_t texel = tile_set_.texel(tile, square_x * side_ + x, square_y * side_ + y);
        std::vector<double>& sum = sums[TurnsOfTexel(texel)];
        sum.resize(k, 0.0);
        const auto codes = table.btfel(BtfelOfTexel(texel));
        for (size_t c = 0; c < k; ++c) {
          sum[c] += share * (table.offset[c] + static_cast<double>(table.step[c]) * codes[c]);
        }
      }
    }
  }

  // [squares]
  [[nodiscard]] std::vector<Eigen::Array3d> Reflected(const Eigen::Vector3d& light,
                                                      const Eigen::Vector3d& view) const {
    std::array<LinearForm, 4> forms;
    for (int t = 0; t < 4; ++t) {
      forms[t] = decoder_.Form(UnturnedFromTurned(light, t), UnturnedFromTurned(view, t));
    }
    std::vector<Eigen::Array3d> reflected;
    for (const std::array<std::vector<double>, 4>& sums : sums_) {
      Eigen::Array3d value = Eigen::Array3d::Zero();
      for (int t = 0; t < 4; ++t) {
        if (!sums[t].empty()) {
          value += forms[t].ValueOf(sums[t]);
        }
      }
      reflected.push_back(value.max(0.0));
    }
    return reflected;
  }

 private:
  const TileSet& tile_set_;
  const Decoder& decoder_;
  int side_;
  std::vector<std::array<std::vector<double>, 4>> sums_;
};

absl::StatusOr<double> RmseAgainst(const TileSet& tile_set, const TileSet& far, int level,
                                   const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(tile_set.btfels));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> far_decoder, MakeDecoder(far.btfels));
  const int squares_across = tile_set.tile_size >> level;
  Squares whole(tile_set, *decoder, 1 << level);
  Squares coarse(far, *far_decoder, (1 << level) / CellSide(tile_set, level));
  const size_t per_tile = static_cast<size_t>(squares_across) * static_cast<size_t>(squares_across);
  for (const size_t at : Scatter(tile_set.tile_codes.size() * per_tile, kErrorTexels)) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const auto tile = static_cast<int>(at / per_tile);
    const int x = static_cast<int>(at % per_tile) % squares_across;
    const int y = static_cast<int>(at % per_tile) / squares_across;
    whole.Add(tile, x, y);
    coarse.Add(tile, x, y);
  }
  const BtfelTable& table = tile_set.btfels;
  double squares = 0.0;
  size_t samples = 0;
  for (size_t pair = 0; pair < kErrorPairs; ++pair) {
    const size_t at = 2 * pair + 1;
    const Eigen::Vector3d view = VectorFromDirection(table.views[at * table.views.size() / 16]);
    const Eigen::Vector3d light = VectorFromDirection(table.lights[at * 5 % 16 * table.lights.size() / 16]);
    const std::vector<Eigen::Array3d> exact = whole.Reflected(light, view);
    const std::vector<Eigen::Array3d> got = coarse.Reflected(light, view);
    for (size_t i = 0; i < exact.size(); ++i) {
      squares += (exact[i] - got[i]).square().sum();
      samples += 3;
    }
  }
  return samples == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(samples));
}

}  // namespace

absl::StatusOr<LevelSet> MakeLevelSet(const TileSet& tile_set, int level, const RunContext& context) {
  if (const int last = LastMipLevel(tile_set.tile_size); level < 1 || level > last) {
    return absl::InvalidArgumentError(absl::StrCat("level ", level, ": tiles of ", tile_set.tile_size, "x",
                                                   tile_set.tile_size, " texels have levels 1 to ", last));
  }
  const std::optional<SourceGrid> grid = SourceGridOf(tile_set);
  if (!grid.has_value() || grid->footprint != 1) {
    return absl::FailedPreconditionError(
        "the tile set does not record where its BTFels lie in the exemplar: synthesise it again");
  }
  const int side = CellSide(tile_set, level);
  LevelSet result;
  TileSet& far = result.tile_set;
  far.arrangement_id = tile_set.arrangement_id;
  far.arrangement_sha256 = tile_set.arrangement_sha256;
  far.tile_size = tile_set.tile_size / side;
  far.strip_height = std::max(tile_set.strip_height / side, 1);
  far.tile_codes = tile_set.tile_codes;
  far.provenance = tile_set.provenance;
  far.radiometry = tile_set.radiometry;
  far.metadata["exemplar"] = {{"width", grid->width}, {"footprint", side}};
  far.btfels = tile_set.btfels.WithoutCodes();
  if (level == 1) {
    far.tile_index = tile_set.tile_index;
    far.source_pixels = tile_set.source_pixels;
    far.btfels.codes = tile_set.btfels.codes;
    return result;
  }
  Cells cells(tile_set, grid->width, side);
  for (size_t tile = 0; tile < tile_set.tile_codes.size(); ++tile) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (int y = 0; y < far.tile_size; ++y) {
      for (int x = 0; x < far.tile_size; ++x) {
        far.tile_index.push_back(cells.TexelOf(static_cast<int>(tile), x, y));
      }
    }
  }
  // Pixels become BTFels, numbered by their rank.
  std::ranges::transform(far.tile_index, std::back_inserter(far.source_pixels), &BtfelOfTexel);
  std::ranges::sort(far.source_pixels);
  far.source_pixels.erase(std::ranges::unique(far.source_pixels).begin(), far.source_pixels.end());
  for (uint32_t& texel : far.tile_index) {
    const auto rank = std::ranges::lower_bound(far.source_pixels, BtfelOfTexel(texel));
    texel = PackTexel(static_cast<uint32_t>(rank - far.source_pixels.begin()), TurnsOfTexel(texel));
  }
  TESSERA_RETURN_IF_ERROR(QuantizeMeans(cells, context, far));
  TESSERA_ASSIGN_OR_RETURN(result.rmse, RmseAgainst(tile_set, far, level, context));
  return result;
}

}  // namespace tessera
