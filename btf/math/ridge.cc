#include "btf/math/ridge.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace tessera {
namespace {

// Eigenvalues below this share of the largest are rounding of 0.
constexpr double kNullEigenvalue = 1e-14;

}  // namespace

SignalEnergies EnergiesOf(const Eigen::MatrixXf& signals, const Eigen::MatrixXf& projected) {
  return {projected.cast<double>().rowwise().squaredNorm(), signals.cast<double>().squaredNorm()};
}

RidgeRegression::RidgeRegression(const Eigen::MatrixXd& basis, const Eigen::MatrixXd& penalty) {
  assert(basis.allFinite() && basis.size() > 0 && penalty.rows() == basis.cols());
  // Not by Cholesky: a penalty may be too badly conditioned for it.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> root(penalty);
  const double least = kNullEigenvalue * root.eigenvalues().maxCoeff();
  const Eigen::MatrixXd w =
      root.eigenvectors() * root.eigenvalues().cwiseMax(least).cwiseSqrt().cwiseInverse().asDiagonal();
  const Eigen::MatrixXd z = basis * w;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(z.transpose() * z);
  back_ = w * eigen.eigenvectors();
  projection_ = eigen.eigenvectors().transpose() * z.transpose();
  // The squared row norms are the eigenvalues; unlike the solver's they cannot be negative in a null space.
  eigenvalues_ = projection_.rowwise().squaredNorm();
}

Eigen::MatrixXf RidgeRegression::Project(const Eigen::MatrixXf& signals) const {
  assert(signals.rows() == projection_.cols());
  // Single precision costs each p_i a rounding of its own row's size only, however small its eigenvalue.
  return projection_.cast<float>() * signals;
}

double RidgeRegression::ChooseRidge(const SignalEnergies& signals, double max_ridge) const {
  const double num_samples = static_cast<double>(projection_.cols());
  const double largest = eigenvalues_.maxCoeff();
  // By eigenvector, the part of the signals' energy that lies along it; what is left no fit can reach.
  Eigen::ArrayXd energies = signals.projected;
  double unreachable = signals.total;
  for (Eigen::Index i = 0; i < energies.size(); ++i) {
    energies[i] = eigenvalues_[i] > kNullEigenvalue * largest ? energies[i] / eigenvalues_[i] : 0.0;
    unreachable -= energies[i];
  }
  unreachable = std::max(unreachable, 0.0);

  std::vector<double> ridges;
  std::vector<double> scores;
  const int count = static_cast<int>(std::lround(std::log10(max_ridge / kMinRidge) * kRidgesPerDecade)) + 1;
  for (int step = 0; step < count; ++step) {
    const double ridge = largest * kMinRidge * std::pow(10.0, step / static_cast<double>(kRidgesPerDecade));
    double residual = unreachable;
    double freedom = num_samples;  // M - trace H
    for (Eigen::Index i = 0; i < energies.size(); ++i) {
      if (eigenvalues_[i] > kNullEigenvalue * largest) {
        const double lost = ridge / (eigenvalues_[i] + ridge);
        residual += lost * lost * energies[i];
        freedom -= 1.0 - lost;
      }
    }
    ridges.push_back(ridge);
    scores.push_back(residual / (freedom * freedom));
  }
  const double limit = *std::ranges::min_element(scores) * (1.0 + kScoreTolerance);
  const auto found = std::ranges::find_if(scores, [&](double score) { return score <= limit; });
  return found == scores.end() ? ridges.front() : ridges[static_cast<size_t>(found - scores.begin())];
}

Eigen::MatrixXd RidgeRegression::FitOfProjected(double ridge) const {
  const Eigen::VectorXd gains =
      (eigenvalues_.array() + ridge > 0.0).select((eigenvalues_.array() + ridge).inverse(), 0.0).matrix();
  return back_ * gains.asDiagonal();
}

Eigen::MatrixXd LeastSquaresFit(const Eigen::MatrixXd& basis, double relative_floor) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(basis, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const double floor = relative_floor * svd.singularValues().maxCoeff();
  const Eigen::VectorXd inverse =
      (svd.singularValues().array() > floor).select(svd.singularValues().array().inverse(), 0.0).matrix();
  return svd.matrixV() * inverse.asDiagonal() * svd.matrixU().transpose();
}

}  // namespace tessera
