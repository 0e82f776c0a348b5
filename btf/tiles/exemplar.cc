#include "btf/tiles/exemplar.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr double kSmallestStep = 1e-6;  // of a constant exemplar: keeps ratios finite

int RoundUp(int n, int multiple) {
  return (n + multiple - 1) / multiple * multiple;
}

}  // namespace

Exemplar::Exemplar(const Embedding& embedding, SeamRule seam_rule, int cut_dims)
    : seam_rule_(seam_rule),
      width_(embedding.width),
      height_(embedding.height),
      dims_(RoundUp(std::min(embedding.dims, cut_dims), kLane)),
      search_dims_(std::min({embedding.dims, cut_dims, kSearchDims})) {
  const int used = std::min(embedding.dims, cut_dims);
  values_.assign(size_t{4} * num_pixels() * dims_, 0.0f);
  for (size_t point = 0; point < size_t{4} * num_pixels(); ++point) {
    std::copy_n(embedding.values.data() + point * embedding.dims, used, values_.data() + point * dims_);
  }

  constexpr std::array<int, 4> kDx = {1, 0, -1, 0};
  constexpr std::array<int, 4> kDy = {0, -1, 0, 1};
  for (int direction = 0; direction < 4; ++direction) {
    for (int pixel = 0; pixel < num_pixels(); ++pixel) {
      beside_.push_back(Shift(static_cast<uint32_t>(pixel), kDx[direction], kDy[direction]));
    }
  }

  for (int turn = 0; turn < 4; ++turn) {
    for (int direction = 0; direction < 4; ++direction) {
      for (int pixel = 0; pixel < num_pixels(); ++pixel) {
        const uint32_t texel = PackTexel(static_cast<uint32_t>(pixel), turn);
        const uint32_t beside = Step(texel, direction);
        step_lengths_.push_back(beside == kNoTexel ? 0.0f : Distance(texel, beside));
      }
    }
  }

  double sum = 0.0;
  int64_t num_steps = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const uint32_t texel = TexelAt(0, x, y);
      for (const int direction : {GridCut::kRight, GridCut::kDown}) {
        if (Step(texel, direction) != kNoTexel) {
          sum += StepLength(texel, direction);
          ++num_steps;
        }
      }
    }
  }
  mean_step_ = std::max(kSmallestStep, sum / static_cast<double>(std::max<int64_t>(1, num_steps)));
  mean_steps_per_unit_ = 1.0 / mean_step_;

  double spread_square = 0.0;
  for (int dim = 0; dim < dims_; ++dim) {
    double mean = 0.0;
    double square = 0.0;
    for (size_t point = 0; point < size_t{4} * num_pixels(); ++point) {
      const double value = values_[point * dims_ + dim];
      mean += value;
      square += value * value;
    }
    const double count = 4.0 * num_pixels();
    mean_.push_back(mean / count);
    const double variance = square / count - (mean / count) * (mean / count);
    spread_square += 2.0 * variance;
    search_spread_ += dim < search_dims_ ? 2.0 * variance : 0.0;
  }
  spread_ = std::max(kSmallestStep, std::sqrt(spread_square));
  search_spread_ = std::max(search_spread_, kSmallestStep * kSmallestStep);
}

uint32_t Exemplar::TexelAt(int turn, int u, int v) const {
  int x = u;
  int y = v;
  switch (turn & 3) {
    case 1:
      x = width_ - 1 - v;
      y = u;
      break;
    case 2:
      x = width_ - 1 - u;
      y = height_ - 1 - v;
      break;
    case 3:
      x = v;
      y = height_ - 1 - u;
      break;
    default:
      break;
  }
  return PackTexel(static_cast<uint32_t>(y * width_ + x), turn);
}

std::array<int, 2> Exemplar::TurnedPosition(uint32_t texel) const {
  const int x = static_cast<int>(BtfelOfTexel(texel)) % width_;
  const int y = static_cast<int>(BtfelOfTexel(texel)) / width_;
  switch (TurnsOfTexel(texel)) {
    case 1:
      return {y, width_ - 1 - x};
    case 2:
      return {width_ - 1 - x, height_ - 1 - y};
    case 3:
      return {height_ - 1 - y, x};
    default:
      return {x, y};
  }
}

uint32_t Exemplar::Shift(uint32_t texel, int dx, int dy) const {
  // A turn of the picture counter-clockwise takes a step (dx, dy) of the unturned exemplar to (dy, -dx).
  for (int i = 0; i < TurnsOfTexel(texel); ++i) {
    const int unturned_dx = -dy;
    dy = dx;
    dx = unturned_dx;
  }
  const int x = static_cast<int>(BtfelOfTexel(texel)) % width_ + dx;
  const int y = static_cast<int>(BtfelOfTexel(texel)) / width_ + dy;
  if (x < 0 || y < 0 || x >= width_ || y >= height_) {
    return kNoTexel;
  }
  return PackTexel(static_cast<uint32_t>(y * width_ + x), TurnsOfTexel(texel));
}

}  // namespace tessera
