#include "btf/math/truncated_svd.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>

#include "btf/base/rng.h"

namespace tessera {
namespace {

// A column that shrinks by this when its parts in the space so far are taken out is rounding of those parts:
// products are floats.
constexpr double kDependence = 1e-6;
// Parts are taken out again until the column keeps this share of its length: twice where the space is
// orthonormal (Kahan; Parlett 1998, 6.9), more often where it is not quite, having been rounded.
constexpr double kSettled = 0.5;

}  // namespace

BlockLanczos::BlockLanczos(Eigen::Index size, Eigen::Index block_size, uint64_t seed)
    : size_(size), block_size_(std::min(block_size, size)), basis_(size, 0), products_(size, 0) {
  assert(size >= 1 && block_size >= 1);
  Rng rng(Mix64(seed, static_cast<uint64_t>(size)));
  Eigen::MatrixXd start(size_, block_size_);
  for (Eigen::Index i = 0; i < start.size(); ++i) {
    start.data()[i] = rng.NextDouble() - 0.5;
  }
  Extend(std::move(start));
}

void BlockLanczos::Extend(Eigen::MatrixXd candidates) {
  const Eigen::Index known = basis_.cols();
  const Eigen::Index room = std::min(block_size_, size_ - known);
  Eigen::Index added = 0;
  basis_.conservativeResize(Eigen::NoChange, known + room);
  for (Eigen::Index i = 0; i < candidates.cols() && added < room; ++i) {
    auto column = candidates.col(i);
    const double before = column.norm();
    double after = before;
    for (bool settled = false; !settled && after > kDependence * before;) {
      const double last = after;
      const auto space = basis_.leftCols(known + added);
      column -= space * (space.transpose() * column).eval();
      after = column.norm();
      settled = after > kSettled * last;
    }
    if (after > kDependence * before && std::isfinite(after)) {
      basis_.col(known + added++) = column / after;
    }
  }
  basis_.conservativeResize(Eigen::NoChange, known + added);
  block_ = basis_.rightCols(added).cast<float>();
  // What was multiplied is what the space holds: the block as rounded to float.
  basis_.rightCols(added) = block_.cast<double>();
}

void BlockLanczos::Add(const Eigen::MatrixXf& product) {
  assert(product.rows() == size_ && product.cols() == block_.cols());
  const Eigen::Index known = products_.cols();
  products_.conservativeResize(Eigen::NoChange, known + product.cols());
  products_.rightCols(product.cols()) = product.cast<double>();
  Extend(products_.rightCols(product.cols()));
}

SingularSpace BlockLanczos::Leading(Eigen::Index rank) const {
  const Eigen::Index m = products_.cols();
  const auto space = basis_.leftCols(m);
  const Eigen::MatrixXd projected = space.transpose() * products_;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (projected + projected.transpose()));
  rank = std::min(rank, m);
  SingularSpace leading;
  leading.values = eigen.eigenvalues().reverse().head(rank).cwiseMax(0.0).cwiseSqrt();
  leading.vectors = space * eigen.eigenvectors().rowwise().reverse().leftCols(rank);
  for (Eigen::Index i = 0; i < rank; ++i) {
    auto column = leading.vectors.col(i);
    Eigen::Index largest = 0;
    column.cwiseAbs().maxCoeff(&largest);
    column *= (column[largest] < 0.0 ? -1.0 : 1.0) / column.norm();
  }
  return leading;
}

}  // namespace tessera
