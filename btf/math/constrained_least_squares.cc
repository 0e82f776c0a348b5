#include "btf/math/constrained_least_squares.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

namespace tessera {
namespace {

// Correctly rounded, so the same on every machine; Eigen's packet square root refines the processor's own
// estimate.
template <typename Lanes>
Lanes Sqrt(const Lanes& x) {
  Lanes root;
  for (int i = 0; i < Lanes::SizeAtCompileTime; ++i) {
    root[i] = std::sqrt(x[i]);
  }
  return root;
}

}  // namespace

template <typename Scalar>
ClsSolver<Scalar>::ClsSolver(const Eigen::MatrixXd& basis) {
  assert(basis.allFinite() && basis.size() > 0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(basis.transpose() * basis);
  const Eigen::MatrixXd projection = eigen.eigenvectors().transpose() * basis.transpose();
  // The squared row norms are the eigenvalues; unlike the solver's they cannot be negative in a null space.
  eigenvalues_ = projection.rowwise().squaredNorm().cast<Scalar>();
  projection_ = projection.cast<Scalar>();
  eigenvectors_ = eigen.eigenvectors().cast<Scalar>();
}

template <typename Scalar>
void ClsSolver<Scalar>::Shrink(const Eigen::Ref<const Vector>& energies,
                               Eigen::Ref<Matrix, 0, Eigen::OuterStride<>> projected) const {
  using Lanes = Eigen::Array<Scalar, kLanes, 1>;
  const Eigen::Index n = eigenvalues_.size();
  assert(projected.cols() == n && projected.rows() == energies.size() && projected.rows() % kLanes == 0);
  const Scalar floor = static_cast<Scalar>(kLambdaFloor) * eigenvalues_.maxCoeff();
  const Scalar tiny = std::numeric_limits<Scalar>::min();
  // Newton roughly doubles the correct digits once close; from the bound below 4 to 6 steps are typical.
  constexpr int kMaxSteps = 40;

  for (Eigen::Index row = 0; row < projected.rows(); row += kLanes) {
    Scalar* const block = projected.data() + row;
    const Eigen::Index stride = projected.outerStride();
    const Lanes energy = energies.template segment<kLanes>(row).array();
    const Lanes inverse_radius = Sqrt<Lanes>(energy.max(tiny)).inverse();
    // Every term alone bounds lambda from below: |p_i| / (w_i + lambda) <= sqrt(E).
    Lanes lambda = Lanes::Constant(floor);
    for (Eigen::Index i = 0; i < n; ++i) {
      const Lanes p = Eigen::Map<const Lanes>(block + i * stride);
      lambda = lambda.max(p.abs() * inverse_radius - eigenvalues_[i]);
    }
    const Lanes limit = energy * static_cast<Scalar>(1.0 + kEnergyTolerance) + tiny;
    for (int step = 0; step < kMaxSteps; ++step) {
      Lanes norm2 = Lanes::Zero();  // |c|^2
      Lanes slope = Lanes::Zero();  // -1/2 d|c|^2 / d lambda
      for (Eigen::Index i = 0; i < n; ++i) {
        const Lanes inverse = (lambda + eigenvalues_[i]).inverse();
        const Lanes c = Eigen::Map<const Lanes>(block + i * stride) * inverse;
        const Lanes c2 = c * c;
        norm2 += c2;
        slope += c2 * inverse;
      }
      const auto is_above = norm2 > limit;
      if (!is_above.any()) {
        break;
      }
      // A signal that has converged keeps its lambda, so the others in its group cannot move it.
      const Lanes next = lambda + norm2 / slope * (Sqrt<Lanes>(norm2) * inverse_radius - Scalar(1));
      lambda = is_above.select(next, lambda);
    }
    for (Eigen::Index i = 0; i < n; ++i) {
      Eigen::Map<Lanes> p(block + i * stride);
      p /= lambda + eigenvalues_[i];
    }
  }
}

template class ClsSolver<float>;
template class ClsSolver<double>;

}  // namespace tessera
