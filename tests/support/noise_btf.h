// A BTF of any size that is made while it is read: a few shiny surfaces, each texel one of them in a colour
// of its own, plus noise that is different in every sample, so that no two texels, views or lights depend on
// each other and no codec can shorten its work.
//
//   NoiseBtf source(800, 800, *DirectionSet("ubo81"), *DirectionSet("ubo81"));
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/data/btf_source.h"

namespace tessera {

class NoiseBtf final : public BtfSource {
 public:
  NoiseBtf(int width, int height, std::vector<Direction> views, std::vector<Direction> lights) {
    info_.width = width;
    info_.height = height;
    info_.views = std::move(views);
    info_.lights = std::move(lights);
    info_.radiometry = "made by the test";
    Rng rng(1);
    for (int i = 0; i < kSurfaces; ++i) {
      const Eigen::Vector3d normal =
          Eigen::Vector3d(rng.NextDouble() - 0.5, rng.NextDouble() - 0.5, 1.0).normalized();
      for (const Direction& view : info_.views) {
        for (const Direction& light : info_.lights) {
          const Eigen::Vector3d wi = VectorFromDirection(light);
          const double lobe = std::max(0.0, normal.dot((wi + VectorFromDirection(view)).normalized()));
          surfaces_.push_back(
              static_cast<float>(std::max(0.0, normal.dot(wi)) * (0.5 + std::pow(lobe, 8.0))));
        }
      }
    }
  }

  [[nodiscard]] const BtfInfo& info() const override { return info_; }

  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    const auto start = std::chrono::steady_clock::now();
    largest_request_ = std::max(largest_request_, num_rows);
    const int64_t first_texel = int64_t{row_begin} * info_.width;
    const size_t per_texel = SamplesPerRow() / info_.width;
    ParallelFor(context, 0, int64_t{num_rows} * info_.width, 16, [&](int64_t begin, int64_t end) {
      for (int64_t texel = begin; texel < end; ++texel) {
        FillTexel(static_cast<uint64_t>(first_texel + texel), samples.data() + texel * per_texel);
      }
    });
    seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return context.CheckStop();
  }

  [[nodiscard]] int largest_request() const { return largest_request_; }  // rows
  // Time spent in ReadRows since the last call.
  [[nodiscard]] double TakeSeconds() { return std::exchange(seconds_, 0.0); }

 private:
  static constexpr int kSurfaces = 8;
  static constexpr float kNoise = 0.2F;

  void FillTexel(uint64_t texel, float* out) const {
    const auto pairs = static_cast<uint32_t>(info_.views.size() * info_.lights.size());
    for (uint64_t channel = 0; channel < 3; ++channel, out += pairs) {
      const uint64_t random = Mix64(texel, channel);
      const float* const surface = surfaces_.data() + Mix64(texel, 3) % kSurfaces * pairs;
      const float albedo = 0.1F + 0.9F * static_cast<float>(random >> 40) * 0x1p-24F;
      const auto key = static_cast<uint32_t>(random);
      for (uint32_t i = 0; i < pairs; ++i) {
        uint32_t hash = (key ^ i) * 0x9E3779B9U;
        hash = (hash ^ hash >> 16) * 0x85EBCA6BU;
        out[i] =
            albedo * surface[i] + kNoise * 0x1p-24F * static_cast<float>(static_cast<int32_t>(hash >> 8));
      }
    }
  }

  BtfInfo info_;
  std::vector<float> surfaces_;  // [surface][view][light]
  int largest_request_ = 0;
  double seconds_ = 0.0;
};

}  // namespace tessera
