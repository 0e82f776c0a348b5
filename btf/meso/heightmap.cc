#include "btf/meso/heightmap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/meso/material_palette.h"

namespace tessera {
namespace {

constexpr double kAspectTolerance = 0.02;

// A square field with `channels` values per pixel.
struct Plane {
  int n = 0;
  int channels = 1;
  std::vector<float> values;
  [[nodiscard]] float at(int x, int y, int c) const {
    return values[(static_cast<size_t>(y) * n + x) * channels + c];
  }
};

absl::Status Validate(const char* name, const Image& image, bool unit_range) {
  if (image.width < 1 || image.height < 1 ||
      (image.channels != 1 && image.channels != 3 && image.channels != 4) ||
      image.pixels.size() != static_cast<size_t>(image.width) * image.height * image.channels) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", image.width, "x", image.height, " with ",
                                                   image.channels, " channels and ", image.pixels.size(),
                                                   " values is no image of 1, 3 or 4 channels"));
  }
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    const float value = image.pixels[i];
    const bool is_alpha = image.channels == 4 && i % 4 == 3;
    if (!std::isfinite(value) || (unit_range && !is_alpha && (value < 0.0F || value > 1.0F))) {
      const size_t pixel = i / image.channels;
      return absl::InvalidArgumentError(absl::StrCat(name, ": pixel (", pixel % image.width, ", ",
                                                     pixel / image.width, ") is ", value, ", expected ",
                                                     unit_range ? "a value in [0, 1]" : "a finite number"));
    }
  }
  return absl::OkStatus();
}

// The central square; grey is repeated to three channels where three are wanted.
Plane CentralSquare(const Image& image, int channels) {
  Plane plane{.n = std::min(image.width, image.height), .channels = channels};
  plane.values.resize(static_cast<size_t>(plane.n) * plane.n * channels);
  const int left = (image.width - plane.n) / 2;
  const int top = (image.height - plane.n) / 2;
  float* out = plane.values.data();
  for (int y = 0; y < plane.n; ++y) {
    for (int x = 0; x < plane.n; ++x) {
      const float* pixel = image.at(left + x, top + y);
      for (int c = 0; c < channels; ++c) {
        *out++ = pixel[image.channels == 1 ? 0 : c];
      }
    }
  }
  return plane;
}

// Whether the step from the last to the first column (along_x) or row is like the steps inside.
bool Repeats(const Plane& plane, bool along_x) {
  double across = 0.0;
  double inside = 0.0;
  const auto value = [&](int a, int b, int c) { return along_x ? plane.at(a, b, c) : plane.at(b, a, c); };
  for (int b = 0; b < plane.n; ++b) {
    for (int c = 0; c < plane.channels; ++c) {
      across += std::abs(value(0, b, c) - value(plane.n - 1, b, c));
      for (int a = 0; a + 1 < plane.n; ++a) {
        inside += std::abs(value(a + 1, b, c) - value(a, b, c));
      }
    }
  }
  return across <= kPeriodicRatio * inside / std::max(1, plane.n - 1);
}

// Where output sample k of n reads its input: taps of a line of `length` pixels, weights summing to 1.
struct Tap {
  int index = 0;
  float weight = 0.0F;
};

// Tent-filtered samples of a line; `blend` lays the line's end over its start (heightmap.h).
std::vector<std::vector<Tap>> Taps(int length, int n, bool blend) {
  const int band = blend ? std::max(1, static_cast<int>(std::lround(kBlendShare * length))) : 0;
  const int period = std::max(1, length - band);
  const double spacing = static_cast<double>(period) / n;
  const double reach = std::max(1.0, spacing);
  std::vector<std::vector<Tap>> lines(n);
  for (int k = 0; k < n; ++k) {
    const double centre = k * spacing - 0.5;  // in pixel indices: pixel i is centred at i + 0.5
    const auto first = static_cast<int>(std::ceil(centre - reach));
    const auto last = static_cast<int>(std::floor(centre + reach));
    double total = 0.0;
    for (int i = first; i <= last; ++i) {
      const double weight = 1.0 - std::abs(i - centre) / reach;
      if (weight <= 0.0) {
        continue;
      }
      const int wrapped = ((i % period) + period) % period;
      total += weight;
      if (wrapped < band && wrapped + period < length) {
        const double old = 1.0 - (wrapped + 0.5) / band;  // share of what would continue the end
        lines[k].push_back({wrapped + period, static_cast<float>(weight * old)});
        lines[k].push_back({wrapped, static_cast<float>(weight * (1.0 - old))});
      } else {
        lines[k].push_back({wrapped, static_cast<float>(weight)});
      }
    }
    for (Tap& tap : lines[k]) {
      tap.weight /= static_cast<float>(total);
    }
  }
  return lines;
}

Plane Resample(const Plane& in, int n, bool blend_x, bool blend_y) {
  const auto taps_x = Taps(in.n, n, blend_x);
  const auto taps_y = Taps(in.n, n, blend_y);
  const int channels = in.channels;
  Plane rows{.n = n, .channels = channels};  // n wide, in.n high
  rows.values.assign(static_cast<size_t>(n) * in.n * channels, 0.0F);
  for (int y = 0; y < in.n; ++y) {
    for (int x = 0; x < n; ++x) {
      for (const Tap& tap : taps_x[x]) {
        for (int c = 0; c < channels; ++c) {
          rows.values[(static_cast<size_t>(y) * n + x) * channels + c] += tap.weight * in.at(tap.index, y, c);
        }
      }
    }
  }
  Plane out{.n = n, .channels = channels};
  out.values.assign(static_cast<size_t>(n) * n * channels, 0.0F);
  const size_t row_values = static_cast<size_t>(n) * channels;
  for (int y = 0; y < n; ++y) {
    for (const Tap& tap : taps_y[y]) {
      const float* source = rows.values.data() + tap.index * row_values;
      float* target = out.values.data() + y * row_values;
      for (size_t i = 0; i < row_values; ++i) {
        target[i] += tap.weight * source[i];
      }
    }
  }
  return out;
}

absl::Status CheckAspect(const char* name, const Image& image, const Image& height) {
  const double expected = static_cast<double>(height.width) / height.height;
  const double found = static_cast<double>(image.width) / image.height;
  if (std::abs(found / expected - 1.0) > kAspectTolerance) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", image.width, "x", image.height,
                                                   " has another aspect ratio than the height image, ",
                                                   height.width, "x", height.height));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<SurfaceMaps> MapsFromImages(const MapParams& params, const Image& height, const Image& colour,
                                           const Image* roughness) {
  TESSERA_RETURN_IF_ERROR(Validate("height", height, false));
  TESSERA_RETURN_IF_ERROR(Validate("colour", colour, true));
  TESSERA_RETURN_IF_ERROR(CheckAspect("colour", colour, height));
  if (roughness != nullptr) {
    TESSERA_RETURN_IF_ERROR(Validate("roughness", *roughness, true));
    TESSERA_RETURN_IF_ERROR(CheckAspect("roughness", *roughness, height));
  }
  const Plane height_plane = CentralSquare(height, 1);
  const Plane colour_plane = CentralSquare(colour, 3);
  std::array<bool, 2> blend{};
  for (int axis = 0; axis < 2; ++axis) {
    blend[axis] = !(Repeats(height_plane, axis == 0) && Repeats(colour_plane, axis == 0));
  }
  SurfaceMaps maps = EmptyMaps(params);
  const int n = maps.resolution();
  maps.height = Resample(height_plane, n, blend[0], blend[1]).values;
  const double scale = params.height_scale_texels > 0.0 ? params.height_scale_texels : kHeightmapScale;
  for (float& z : maps.height) {
    z *= static_cast<float>(scale);
  }
  const auto [low, high] = std::minmax_element(maps.height.begin(), maps.height.end());
  if (const double range = static_cast<double>(*high) - *low; !(range <= params.size / 4.0)) {
    return absl::InvalidArgumentError(absl::StrCat("height: the field spans ", range,
                                                   " texels at a scale of ", scale,
                                                   ", expected at most size / 4 = ", params.size / 4.0));
  }
  maps.albedo = Resample(colour_plane, n, blend[0], blend[1]).values;
  for (float& albedo : maps.albedo) {
    albedo = std::clamp(albedo, 0.0F, 1.0F);  // the taps' weights sum to 1 up to rounding
  }
  if (roughness != nullptr) {
    maps.roughness = Resample(CentralSquare(*roughness, 1), n, blend[0], blend[1]).values;
  } else {
    std::fill(maps.roughness.begin(), maps.roughness.end(), kHeightmapRoughness);
  }
  return maps;
}

}  // namespace tessera
