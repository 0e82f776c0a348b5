#include "btf/tiles/anisotropy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Core>

#include "btf/base/parallel.h"

namespace tessera {
namespace {

constexpr double kSmallestDistance = 0.01;  // of the exemplar's spread
constexpr int kOffsetsAtOnce = 256;         // columns of a product: what threads share

// A rectangle of the unturned exemplar.
struct Crop {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

// The patches of a crop, a column each, `step` texels apart, seen after `turn` quarter turns.
Eigen::MatrixXf PatchesOf(const Exemplar& exemplar, const Crop& crop, int turn, int step) {
  const int dims = exemplar.search_dims();
  const int across = (crop.width - kAnisotropyPatch) / step + 1;
  const int down = (crop.height - kAnisotropyPatch) / step + 1;
  Eigen::MatrixXf patches(kAnisotropyPatch * kAnisotropyPatch * dims, across * down);
  for (int place = 0; place < across * down; ++place) {
    float* value = patches.col(place).data();
    const int left = crop.x + place % across * step;
    const int top = crop.y + place / across * step;
    for (int v = 0; v < kAnisotropyPatch; ++v) {
      for (int u = 0; u < kAnisotropyPatch; ++u) {
        // Where the patch turned counter-clockwise takes this texel from.
        int x = u;
        int y = v;
        for (int i = 0; i < turn; ++i) {
          const int turned_x = kAnisotropyPatch - 1 - y;
          y = x;
          x = turned_x;
        }
        const auto pixel = static_cast<uint32_t>((top + y) * exemplar.width() + left + x);
        value = std::copy_n(exemplar.Point(PackTexel(pixel, turn)), dims, value);
      }
    }
  }
  return patches;
}

// Mean over the columns of `wanted` of the distance to the nearest column of `offered`.
double MeanNearest(const Eigen::MatrixXf& wanted, const Eigen::MatrixXf& offered, double least,
                   const RunContext& context) {
  const Eigen::RowVectorXf offered_squares = offered.colwise().squaredNorm();
  const Eigen::Index num_parts = (offered.cols() + kOffsetsAtOnce - 1) / kOffsetsAtOnce;
  // Of each wanted patch in each part, the squared distance less the patch's own square.
  Eigen::MatrixXf nearest = Eigen::MatrixXf::Zero(wanted.cols(), num_parts);
  ParallelFor(context, 0, num_parts, 1, [&](int64_t part, int64_t) {
    const Eigen::Index first = part * kOffsetsAtOnce;
    const Eigen::Index count = std::min<Eigen::Index>(kOffsetsAtOnce, offered.cols() - first);
    Eigen::MatrixXf distances = -2.0f * (wanted.transpose() * offered.middleCols(first, count));
    distances.rowwise() += offered_squares.segment(first, count);
    nearest.col(part) = distances.rowwise().minCoeff();
  });
  double sum = 0.0;
  for (Eigen::Index patch = 0; patch < wanted.cols(); ++patch) {
    const double square = wanted.col(patch).squaredNorm() + nearest.row(patch).minCoeff();
    sum += std::max(least, std::sqrt(std::max(0.0, square)));
  }
  return sum / static_cast<double>(wanted.cols());
}

}  // namespace

double MeasureAnisotropy(const Exemplar& exemplar, const RunContext& context) {
  const int width = std::min(exemplar.width(), kAnisotropySide);
  const int height = std::min(exemplar.height(), kAnisotropySide);
  if (width < 2 * kAnisotropyPatch || height < 2 * kAnisotropyPatch) {
    return 1.0;
  }
  const int left = (exemplar.width() - width) / 2;
  const int top = (exemplar.height() - height) / 2;
  const std::array<std::array<Crop, 2>, 2> splits = {
      {{{{left, top, width / 2, height}, {left + width / 2, top, width - width / 2, height}}},
       {{{left, top, width, height / 2}, {left, top + height / 2, width, height - height / 2}}}}};
  const double least = kSmallestDistance * std::sqrt(exemplar.search_spread()) * kAnisotropyPatch;
  double unturned = 0.0;
  double turned = 0.0;
  for (const auto& halves : splits) {
    for (int half = 0; half < 2; ++half) {
      const Eigen::MatrixXf offered = PatchesOf(exemplar, halves[1 - half], 0, 1);
      const auto mean_nearest = [&](int turn) {
        return MeanNearest(PatchesOf(exemplar, halves[half], turn, kAnisotropyPatch), offered, least,
                           context);
      };
      unturned += mean_nearest(0);
      turned += (mean_nearest(1) + mean_nearest(3)) / 2.0;
    }
  }
  return unturned > 0.0 ? turned / unturned : 1.0;
}

}  // namespace tessera
