// BTFs in memory for the codec's tests.
#pragma once

#include <cmath>
#include <utility>
#include <vector>

#include "btf/base/rng.h"
#include "btf/data/btf_source.h"
#include "btf/math/conventions.h"

namespace tessera {

// Rings at equal polar steps from 0 to `max_theta_deg`, the first a single direction.
inline std::vector<Direction> RingDirections(int rings, int azimuths, double max_theta_deg = 75.0) {
  std::vector<Direction> directions = {{0.0, 0.0}};
  for (int ring = 1; ring < rings; ++ring) {
    for (int i = 0; i < azimuths; ++i) {
      directions.push_back({RadFromDeg(max_theta_deg * ring / (rings - 1)), 2.0 * kPi * i / azimuths});
    }
  }
  return directions;
}

// Samples held in ReadRows' layout.
class SampledBtf final : public BtfSource {
 public:
  SampledBtf(int width, int height, std::vector<Direction> views, std::vector<Direction> lights) {
    info_.width = width;
    info_.height = height;
    info_.views = std::move(views);
    info_.lights = std::move(lights);
    info_.radiometry = "made by the test";
    info_.provenance.source = "the test";
    samples_.resize(SamplesPerRow() * height);
  }

  [[nodiscard]] const BtfInfo& info() const override { return info_; }

  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& /*context*/) override {
    if (row_begin < 0 || row_begin + num_rows > info_.height ||
        samples.size() != SamplesPerRow() * num_rows) {
      return absl::InvalidArgumentError("rows");
    }
    largest_request_ = std::max(largest_request_, num_rows);
    std::copy_n(samples_.begin() + static_cast<ptrdiff_t>(SamplesPerRow()) * row_begin, samples.size(),
                samples.begin());
    return absl::OkStatus();
  }

  float& at(int x, int y, int channel, size_t view, size_t light) {
    return samples_[(((static_cast<size_t>(y) * info_.width + x) * 3 + channel) * info_.views.size() + view) *
                        info_.lights.size() +
                    light];
  }
  [[nodiscard]] int largest_request() const { return largest_request_; }

 private:
  BtfInfo info_;
  std::vector<float> samples_;
  int largest_request_ = 0;
};

// A tilted, coloured, shiny surface: every texel has its own normal, albedo and lobe. Turning it about the
// normal changes it.
inline SampledBtf ShinyBtf(int width, int height, const std::vector<Direction>& views,
                           const std::vector<Direction>& lights, uint64_t seed = 1) {
  SampledBtf btf(width, height, views, lights);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Rng rng(Mix64(seed, static_cast<uint64_t>(y) * width + x));
      const Eigen::Vector3d normal =
          Eigen::Vector3d(0.8 * (rng.NextDouble() - 0.5), 0.5 * (rng.NextDouble() - 0.5), 1.0).normalized();
      const double gloss = 4.0 + 12.0 * rng.NextDouble();
      const double albedo[3] = {rng.NextDouble(), 0.5 * rng.NextDouble(), 0.2 + 0.3 * rng.NextDouble()};
      for (size_t v = 0; v < views.size(); ++v) {
        for (size_t l = 0; l < lights.size(); ++l) {
          const Eigen::Vector3d wi = VectorFromDirection(lights[l]);
          const Eigen::Vector3d wo = VectorFromDirection(views[v]);
          const double cosine = std::max(0.0, normal.dot(wi));
          const double lobe = 0.3 * std::pow(std::max(0.0, normal.dot((wi + wo).normalized())), gloss);
          for (int channel = 0; channel < 3; ++channel) {
            btf.at(x, y, channel, v, l) = static_cast<float>(cosine * (albedo[channel] + lobe));
          }
        }
      }
    }
  }
  return btf;
}

}  // namespace tessera
