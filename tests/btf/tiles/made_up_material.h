// Made-up materials for tests of synthesis.
#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/data/direction_sets.h"
#include "btf/data/memory_btf.h"
#include "btf/math/conventions.h"
#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {

// Of width x height texels, three polar angles by four azimuths of views and of lights; value(x, y, channel,
// light) is the same from every view.
template <typename Value>
Material MadeUpMaterial(int width, int height, std::string_view codec, const Value& value) {
  BtfInfo info{.width = width,
               .height = height,
               .views = *DirectionSet("3x4"),
               .lights = *DirectionSet("3x4"),
               .provenance = {.source = "made up", .licence = "CC0", .citation = ""},
               .radiometry = "reflectance"};
  std::vector<float> samples;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        for (size_t view = 0; view < info.views.size(); ++view) {
          for (const Direction& light : info.lights) {
            samples.push_back(static_cast<float>(value(x, y, channel, light)));
          }
        }
      }
    }
  }
  const auto source = MemoryBtf::Create(info, samples);
  EXPECT_TRUE(source.ok()) << source.status();
  absl::StatusOr<Material> material = FindCodec(codec)->Encode(**source, {.kl = 9, .kv = 1}, RunContext{});
  EXPECT_TRUE(material.ok()) << material.status();
  return *std::move(material);
}

enum class Pattern { kBumps, kStripes };

// A diffuse surface of bumps or of stripes along x.
inline Material MakeMaterial(int width, int height, Pattern pattern, std::string_view codec = "dsh-cls") {
  const std::vector<double> noise = SmoothNoise(width, height, 2, 11);
  const auto at = [&](int x, int y) {
    x = (x + width) % width;
    y = (y + height) % height;
    return pattern == Pattern::kBumps ? noise[static_cast<size_t>(y) * width + x] : 0.4 * std::sin(1.3 * y);
  };
  return MadeUpMaterial(width, height, codec, [&](int x, int y, int channel, const Direction& light) {
    const Eigen::Vector3d normal =
        Eigen::Vector3d(at(x - 1, y) - at(x + 1, y), at(x, y + 1) - at(x, y - 1), 1.0).normalized();
    const double albedo = 0.4 + 0.2 * at(x, y) + 0.05 * channel;
    return albedo * std::max(0.0, normal.dot(VectorFromDirection(light)));
  });
}

}  // namespace tessera
