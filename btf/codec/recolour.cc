#include "btf/codec/recolour.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/quantize.h"

namespace tessera {
namespace {

// Coefficients of one channel stand in runs, those of the three channels behind each other.
absl::StatusOr<int> ChannelRun(const BtfelTable& table) {
  const auto parameter = [&](const char* key) {
    const auto found = table.parameters.find(key);
    return found != table.parameters.end() && found->is_number_integer() ? found->get<int>() : -1;
  };
  int run = 0;
  if (table.codec_id.starts_with("dsh")) {
    run = table.num_coefficients / 3;
  } else if (table.codec_id == "view-pca") {
    run = parameter("eigen_textures") + 1;
  } else {
    return absl::UnimplementedError(
        absl::StrCat("codec \"", table.codec_id,
                     "\": its channels share coefficients, so the colour of some texels cannot be changed; "
                     "encode with dsh, dsh-cls or view-pca"));
  }
  if (run < 1 || table.num_coefficients % (3 * run) != 0) {
    return absl::InvalidArgumentError(absl::StrCat("codec \"", table.codec_id, "\": ", table.num_coefficients,
                                                   " coefficients are not three channels of ", run));
  }
  return run;
}

// Values of a BTFel after the map.
void MapBtfel(const BtfelTable& table, int run, const Eigen::Matrix3d& map, size_t btfel,
              std::span<float> values) {
  const std::span<const uint8_t> codes = table.btfel(btfel);
  const auto value = [&](size_t i) {
    return table.offset[i] + static_cast<double>(table.step[i]) * codes[i];
  };
  for (size_t first = 0; first < values.size(); first += 3 * static_cast<size_t>(run)) {
    for (int i = 0; i < run; ++i) {
      const size_t red = first + i;
      const Eigen::Vector3d rgb(value(red), value(red + run), value(red + 2 * run));
      const Eigen::Vector3d mapped = map * rgb;
      for (int channel = 0; channel < 3; ++channel) {
        values[red + static_cast<size_t>(channel) * run] = static_cast<float>(mapped[channel]);
      }
    }
  }
}

}  // namespace

Eigen::Matrix3d HueSaturationMap(double hue_rad, double saturation) {
  const Eigen::RowVector3d luminance(0.2126, 0.7152, 0.0722);
  const Eigen::Vector3d grey = Eigen::Vector3d::Constant(1.0 / std::numbers::sqrt3);
  Eigen::Matrix3d quarter_turn;  // of the chroma plane
  quarter_turn << 0.0, -1.0, 1.0, 1.0, 0.0, -1.0, -1.0, 1.0, 0.0;
  quarter_turn /= std::numbers::sqrt3;
  const Eigen::Matrix3d chroma = Eigen::Matrix3d::Identity() - grey * grey.transpose();
  const Eigen::Matrix3d turned = saturation * (std::cos(hue_rad) * chroma + std::sin(hue_rad) * quarter_turn);
  return turned + Eigen::Vector3d::Ones() * (luminance - luminance * turned);
}

absl::Status RecolourTexels(std::span<const Eigen::Matrix3d> maps, std::span<const uint8_t> map_of_texel,
                            Material& material) {
  BtfelTable& table = material.btfels;
  if (map_of_texel.size() != table.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(map_of_texel.size(), " entries for ", table.size(), " texels"));
  }
  for (const uint8_t map : map_of_texel) {
    if (map > maps.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("colour map ", static_cast<int>(map), " of ", maps.size()));
    }
  }
  for (const Eigen::Matrix3d& map : maps) {
    if (!map.allFinite()) {
      return absl::InvalidArgumentError("a colour map is not finite");
    }
  }
  TESSERA_ASSIGN_OR_RETURN(const int run, ChannelRun(table));
  const auto k = static_cast<size_t>(table.num_coefficients);

  constexpr float kLargestCode = 255.0F;
  std::vector<float> low = table.offset;
  std::vector<float> high(k);
  for (size_t i = 0; i < k; ++i) {
    high[i] = table.offset[i] + kLargestCode * table.step[i];
  }
  const std::vector<float> old_low = low;
  const std::vector<float> old_high = high;
  std::vector<float> values(k);
  for (size_t texel = 0; texel < map_of_texel.size(); ++texel) {
    if (map_of_texel[texel] != 0) {
      MapBtfel(table, run, maps[map_of_texel[texel] - 1], texel, values);
      for (size_t i = 0; i < k; ++i) {
        low[i] = std::min(low[i], values[i]);
        high[i] = std::max(high[i], values[i]);
      }
    }
  }
  Quantisation quantisation = UniformQuantisation(low, high);
  std::vector<size_t> outgrown;
  for (size_t i = 0; i < k; ++i) {
    if (low[i] == old_low[i] && high[i] == old_high[i]) {
      quantisation.offset[i] = table.offset[i];
      quantisation.step[i] = table.step[i];
    } else {
      outgrown.push_back(i);
    }
  }
  const Eigen::Matrix3d as_it_is = Eigen::Matrix3d::Identity();
  std::vector<uint8_t> codes(k);
  for (size_t texel = 0; texel < map_of_texel.size(); ++texel) {
    const int map = map_of_texel[texel];
    if (map == 0 && outgrown.empty()) {
      continue;
    }
    MapBtfel(table, run, map == 0 ? as_it_is : maps[map - 1], texel, values);
    Quantize(quantisation, values, codes);
    const std::span<uint8_t> stored = std::span(table.codes).subspan(texel * k, k);
    if (map != 0) {
      std::copy(codes.begin(), codes.end(), stored.begin());
    }
    for (const size_t i : outgrown) {
      stored[i] = codes[i];
    }
  }
  table.offset = std::move(quantisation.offset);
  table.step = std::move(quantisation.step);
  return absl::OkStatus();
}

}  // namespace tessera
