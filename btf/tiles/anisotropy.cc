#include "btf/tiles/anisotropy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <vector>

#include <Eigen/Core>

#include "btf/base/parallel.h"

namespace tessera {
namespace {

// One turn of the exemplar as a picture: rows of points about their mean.
struct Picture {
  int width = 0;
  int height = 0;
  Eigen::VectorXd mean;
  Eigen::MatrixXf points;  // [dims][height * width]
};

Picture TurnedPicture(const Exemplar& exemplar, int turn) {
  Picture picture{
      .width = exemplar.TurnedWidth(turn), .height = exemplar.TurnedHeight(turn), .mean = {}, .points = {}};
  picture.points.resize(exemplar.search_dims(), exemplar.num_pixels());
  for (int v = 0; v < picture.height; ++v) {
    for (int u = 0; u < picture.width; ++u) {
      picture.points.col(v * picture.width + u) = Eigen::Map<const Eigen::VectorXf>(
          exemplar.Point(exemplar.TexelAt(turn, u, v)), exemplar.search_dims());
    }
  }
  picture.mean = picture.points.cast<double>().rowwise().mean();
  picture.points.colwise() -= picture.mean.cast<float>();
  return picture;
}

// Means over texels p of (point at p) (point at p + d)^T, p in the upper and in the lower half of the
// picture.
std::array<Eigen::MatrixXd, 2> CrossCovariances(const Picture& picture, int dx, int dy) {
  const auto dims = picture.points.rows();
  std::array<Eigen::MatrixXd, 2> halves;
  const int x0 = std::max(0, -dx);
  const int width = picture.width - std::abs(dx);
  const int height = picture.height - dy;
  const std::array<int, 3> bounds = {0, height / 2, height};
  for (int half = 0; half < 2; ++half) {
    halves[half] = Eigen::MatrixXd::Zero(dims, dims);
    for (int y = bounds[half]; y < bounds[half + 1]; ++y) {
      halves[half] += (picture.points.middleCols(y * picture.width + x0, width) *
                       picture.points.middleCols((y + dy) * picture.width + x0 + dx, width).transpose())
                          .cast<double>();
    }
    halves[half] /= static_cast<double>(width) * (bounds[half + 1] - bounds[half]);
  }
  return halves;
}

}  // namespace

Anisotropy MeasureAnisotropy(const Exemplar& exemplar, const RunContext& context) {
  const std::array<Picture, 2> pictures = {TurnedPicture(exemplar, 0), TurnedPicture(exemplar, 1)};
  // C(-d) = C(d)^T: half of the offsets tell all.
  std::vector<std::array<int, 2>> offsets;
  for (int dy = 0; dy <= kAnisotropyRadius; ++dy) {
    for (int dx = dy == 0 ? 0 : -kAnisotropyRadius; dx <= kAnisotropyRadius; ++dx) {
      offsets.push_back({dx, dy});
    }
  }
  std::vector<double> differences(offsets.size(), 0.0);
  std::vector<double> squares(offsets.size(), 0.0);
  ParallelFor(context, 0, static_cast<int64_t>(offsets.size()), 8, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const auto [unturned_a, unturned_b] = CrossCovariances(pictures[0], offsets[i][0], offsets[i][1]);
      const auto [turned_a, turned_b] = CrossCovariances(pictures[1], offsets[i][0], offsets[i][1]);
      const Eigen::MatrixXd unturned = (unturned_a + unturned_b) / 2.0;
      const Eigen::MatrixXd turned = (turned_a + turned_b) / 2.0;
      // Halves of one picture differ by chance alone, in the mean square by twice what two whole pictures do.
      const double chance =
          ((unturned_a - unturned_b).squaredNorm() + (turned_a - turned_b).squaredNorm()) / 4.0;
      differences[i] = (unturned - turned).squaredNorm() - chance;
      squares[i] = unturned.squaredNorm() + turned.squaredNorm();
    }
  });
  Anisotropy anisotropy;
  double difference = 0.0;
  double square = 0.0;
  for (size_t i = 0; i < offsets.size(); ++i) {
    difference += differences[i];
    square += squares[i];
  }
  anisotropy.pattern = square > 0.0 ? std::sqrt(std::max(0.0, difference) / square) : 0.0;
  const double mean_difference = (pictures[0].mean - pictures[1].mean).squaredNorm();
  const double variance =
      (pictures[0].points.squaredNorm() + pictures[1].points.squaredNorm()) / (2.0 * exemplar.num_pixels());
  anisotropy.mean = mean_difference > 0.0 ? std::sqrt(mean_difference / (mean_difference + variance)) : 0.0;
  return anisotropy;
}

}  // namespace tessera
