// The BTF that codecs are timed on: 128x128 texels, 81 views x 81 lights, tilted and shiny with a little
// noise.
#pragma once

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/data/btf_source.h"
#include "btf/math/conventions.h"

namespace tessera::bench {

inline constexpr int kSize = 128;

// The UBO2003 directions, 81.
inline std::vector<Direction> Ubo81() {
  constexpr int kCounts[] = {1, 6, 12, 18, 20, 24};
  std::vector<Direction> directions;
  for (int ring = 0; ring < 6; ++ring) {
    for (int i = 0; i < kCounts[ring]; ++i) {
      directions.push_back({RadFromDeg(15.0 * ring), 2.0 * kPi * i / kCounts[ring]});
    }
  }
  return directions;
}

// One prepared row, copied for every request; the copies' time is taken out of the encoder's.
class RepeatedRow final : public BtfSource {
 public:
  RepeatedRow() {
    info_.width = kSize;
    info_.height = kSize;
    info_.views = Ubo81();
    info_.lights = Ubo81();
    row_.resize(SamplesPerRow());
    Rng rng(1);
    size_t index = 0;
    for (int x = 0; x < kSize; ++x) {
      const Eigen::Vector3d normal =
          Eigen::Vector3d(rng.NextDouble() - 0.5, rng.NextDouble() - 0.5, 1.0).normalized();
      for (int channel = 0; channel < 3; ++channel) {
        const double albedo = rng.NextDouble();
        for (const Direction& view : info_.views) {
          for (const Direction& light : info_.lights) {
            const Eigen::Vector3d wi = VectorFromDirection(light);
            const double lobe = normal.dot((wi + VectorFromDirection(view)).normalized());
            row_[index++] = static_cast<float>(albedo * std::max(0.0, normal.dot(wi)) +
                                               0.3 * lobe * lobe * lobe + 0.02 * rng.NextDouble());
          }
        }
      }
    }
  }
  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int /*row_begin*/, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    const auto start = std::chrono::steady_clock::now();
    ParallelFor(context, 0, num_rows, 1, [&](int64_t first, int64_t last) {
      for (int64_t row = first; row < last; ++row) {
        std::ranges::copy(row_, samples.begin() + static_cast<ptrdiff_t>(row_.size()) * row);
      }
    });
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return absl::OkStatus();
  }
  [[nodiscard]] double TakeSeconds() { return std::exchange(seconds_, 0.0); }
  [[nodiscard]] const std::vector<float>& row() const { return row_; }

 private:
  BtfInfo info_;
  std::vector<float> row_;
  double seconds_ = 0.0;
};

}  // namespace tessera::bench
