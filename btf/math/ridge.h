// Ridge regression with one ridge for many signals, chosen by generalised cross-validation.
//
// For samples f (M of them), basis Y [M][n] and a penalty R: c = (Y^T Y + ridge R)^-1 Y^T f, a linear map for
// a given ridge. The ridge is that of the least score
//
//   GCV(ridge) = (sum over signals |f - Y c|^2) / (M - trace H)^2,   H = Y (Y^T Y + ridge R)^-1 Y^T,
//
// the error of leaving out each sample in turn, made independent of the choice of coordinates (Golub, Heath
// and Wahba 1979, Technometrics 21). With R^-1 = W W^T, Z = Y W, Z^T Z = Q diag(w) Q^T and p = Q^T Z^T f it
// takes sums over the signals of p_i^2 and |f|^2 only.
//
//   RidgeRegression regression(basis);
//   const Eigen::MatrixXf projected = regression.Project(signals);   // a sample is enough
//   const double ridge = regression.ChooseRidge(EnergiesOf(signals, projected), 10.0);
//   coefficients = regression.Fit(ridge) * all_signals;
#pragma once

#include <Eigen/Core>

namespace tessera {

// What the choice of a ridge needs of signals; that of more signals is the sum.
struct SignalEnergies {
  Eigen::VectorXd projected;  // [n], sums of p_i^2
  double total = 0.0;         // sum of |f|^2
};

// Of signals [M][any number] and what RidgeRegression::Project made of them.
[[nodiscard]] SignalEnergies EnergiesOf(const Eigen::MatrixXf& signals, const Eigen::MatrixXf& projected);

// Immutable after construction, safe to share between threads.
class RidgeRegression {
 public:
  // The ridges tried: kRidgesPerDecade from kMinRidge on, relative to the largest eigenvalue w.
  static constexpr double kMinRidge = 1e-6;
  static constexpr int kRidgesPerDecade = 8;
  // Scores are estimates and flat near the least: of the ridges within this share of it, the smallest is
  // taken, the closest to the samples. It also settles ties (one sample, signals that are 0).
  static constexpr double kScoreTolerance = 0.01;

  // basis [M][n], both >= 1, finite; M < n is fine. penalty [n][n], symmetric,
  // positive definite as far as double tells. Cost n^3.
  RidgeRegression(const Eigen::MatrixXd& basis, const Eigen::MatrixXd& penalty);
  // The identity as the penalty.
  explicit RidgeRegression(const Eigen::MatrixXd& basis)
      : RidgeRegression(basis, Eigen::MatrixXd::Identity(basis.cols(), basis.cols())) {}

  // p of finite signals [M][any number], [n][as many].
  [[nodiscard]] Eigen::MatrixXf Project(const Eigen::MatrixXf& signals) const;

  // One of the ridges above up to max_ridge (> kMinRidge, relative as well), absolute. 0 when the basis is 0.
  [[nodiscard]] double ChooseRidge(const SignalEnergies& signals, double max_ridge) const;

  // [n][M]; ridge > 0, or 0 for a basis of 0 (then 0).
  [[nodiscard]] Eigen::MatrixXd Fit(double ridge) const { return FitOfProjected(ridge) * projection_; }

  // [n][n], from p to coefficients; ridges as above.
  [[nodiscard]] Eigen::MatrixXd FitOfProjected(double ridge) const;

 private:
  Eigen::MatrixXd back_;         // W Q
  Eigen::MatrixXd projection_;   // Q^T Z^T
  Eigen::VectorXd eigenvalues_;  // w
};

// The pseudo-inverse of basis [M][n], [n][M]: plain least squares, the smallest coefficients of those that
// fit equally well. Singular values below `relative_floor` of the largest count as 0.
[[nodiscard]] Eigen::MatrixXd LeastSquaresFit(const Eigen::MatrixXd& basis, double relative_floor);

}  // namespace tessera
