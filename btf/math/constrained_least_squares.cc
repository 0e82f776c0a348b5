#include "btf/math/constrained_least_squares.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

namespace tessera {
namespace {

// std::sqrt is correctly rounded, so the same on every machine; Eigen's packets refine an estimate. A loop of
// nothing else, for the compiler to turn into vector instructions.
template <typename Lanes>
Lanes SquareRoots(const Lanes& x) {
  Lanes roots;
  for (int lane = 0; lane < Lanes::SizeAtCompileTime; ++lane) {
    roots[lane] = std::sqrt(x[lane]);
  }
  return roots;
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
  // Newton roughly doubles the correct digits once close.
  constexpr int kMaxSteps = 40;

  for (Eigen::Index row = 0; row < projected.rows(); row += kLanes) {
    Scalar* const block = projected.data() + row;
    const Eigen::Index stride = projected.outerStride();
    const Lanes energy = energies.template segment<kLanes>(row).array();
    const Lanes inverse_radius = SquareRoots<Lanes>(energy.max(tiny)).inverse();
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
      const auto add = [&](Eigen::Index i, const Lanes& inverse) {
        const Lanes c = Eigen::Map<const Lanes>(block + i * stride) * inverse;
        const Lanes c2 = c * c;
        norm2 += c2;
        slope += c2 * inverse;
      };
      // Division is what takes the time: one for two terms.
      for (Eigen::Index i = 0; i + 1 < n; i += 2) {
        const Lanes first = lambda + eigenvalues_[i];
        const Lanes second = lambda + eigenvalues_[i + 1];
        const Lanes inverse = (first * second).inverse();
        add(i, second * inverse);
        add(i + 1, first * inverse);
      }
      if (n % 2 != 0) {
        add(n - 1, (lambda + eigenvalues_[n - 1]).inverse());
      }
      if (!((norm2 - limit).maxCoeff() > Scalar(0))) {
        break;
      }
      const Lanes next = lambda + norm2 / slope * (SquareRoots<Lanes>(norm2) * inverse_radius - Scalar(1));
      // A signal that has converged keeps its lambda, so the others in its group cannot move it. Plain lanes,
      // for the compiler to turn into a blend: Eigen's select is not vectorised.
      for (int lane = 0; lane < kLanes; ++lane) {
        lambda[lane] = norm2[lane] > limit[lane] ? next[lane] : lambda[lane];
      }
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
