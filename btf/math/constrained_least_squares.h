// Constrained least squares in closed form: fits whose coefficient norm is bounded by the signal's energy, so
// that they survive noise and quantisation.
//
// For samples f (M of them) and basis Y [M][n]: the smallest lambda >= 0 for which c = (A + lambda I)^-1 Y^T
// f has |c|^2 <= E, with A = Y^T Y. Source: [Leung2007] appendix, eq. 3-7, there by a factorisation for each
// trial lambda and signal. Here A = Q diag(w) Q^T once per direction set, so that
//
//   c(lambda) = Q diag(1 / (w + lambda)) p,   p = Q^T Y^T f,   |c|^2 = sum p_i^2 / (w_i + lambda)^2,
//
// and lambda is found for many signals at once by Newton's method on 1 / |c(lambda)|, which is concave and
// nearly linear: started below the root it rises to it without passing it (More and Sorensen 1983, SIAM J.
// Sci. Stat. Comput. 4, sec. 3).
//
//   ClsSolver<float> solver(basis);
//   projected = samples^T * solver.projection().transpose();         // [signals][n], one GEMM
//   solver.Shrink(energies, projected);                              // in place
//   coefficients = projected * solver.eigenvectors().transpose();    // [signals][n], the other
#pragma once

#include <Eigen/Core>

namespace tessera {

// Scalar is float or double. Immutable after construction, safe to share between threads.
template <typename Scalar>
class ClsSolver {
 public:
  using Matrix = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;
  using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

  // lambda never falls below this share of the largest eigenvalue. In float, rounding of the projections
  // would otherwise reach the coefficients; in double it only keeps the null space of too few directions out.
  static constexpr double kLambdaFloor = sizeof(Scalar) == 4 ? 1e-6 : 1e-14;
  // Newton stops when |c|^2 exceeds E by less than this share.
  static constexpr double kEnergyTolerance = sizeof(Scalar) == 4 ? 1e-5 : 1e-12;
  // Signals are processed in groups of this size, enough to hide the latency of their sums; Shrink wants
  // padded rows.
  static constexpr int kLanes = 32;

  // basis [M][n], both >= 1, finite and not all zero; M < n is fine. Cost n^3.
  explicit ClsSolver(const Eigen::MatrixXd& basis);

  [[nodiscard]] int num_samples() const { return static_cast<int>(projection_.cols()); }
  [[nodiscard]] int num_unknowns() const { return static_cast<int>(projection_.rows()); }
  // Q^T Y^T, [n][M]. Row i has norm sqrt(w_i), which is why p may be computed in float.
  [[nodiscard]] const Matrix& projection() const { return projection_; }
  // Q, [n][n].
  [[nodiscard]] const Matrix& eigenvectors() const { return eigenvectors_; }
  // w, [n], ascending, >= 0.
  [[nodiscard]] const Vector& eigenvalues() const { return eigenvalues_; }

  // Replaces each row p of `projected` by p / (w + lambda), lambda as above for the row's energy (>= 0).
  // projected is [rows][n] (column-major, any outer stride), energies [rows]; rows is a multiple of kLanes.
  // Rows do not influence each other, in no bit. Every result is finite when its p and energy are.
  void Shrink(const Eigen::Ref<const Vector>& energies,
              Eigen::Ref<Matrix, 0, Eigen::OuterStride<>> projected) const;

 private:
  Matrix projection_;
  Matrix eigenvectors_;
  Vector eigenvalues_;
};

extern template class ClsSolver<float>;
extern template class ClsSolver<double>;

}  // namespace tessera
