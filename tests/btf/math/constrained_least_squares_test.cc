#include "btf/math/constrained_least_squares.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "btf/base/rng.h"
#include "btf/math/conventions.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

// A UBO-like set: rings at 0, 15, .. degrees.
Eigen::Matrix3Xd Rings() {
  constexpr int kCounts[] = {1, 6, 12, 18, 20, 24};
  Eigen::Matrix3Xd directions(3, 81);
  int column = 0;
  for (int ring = 0; ring < 6; ++ring) {
    for (int i = 0; i < kCounts[ring]; ++i) {
      directions.col(column++) =
          VectorFromDirection({RadFromDeg(15.0 * ring), 2.0 * kPi * i / kCounts[ring]});
    }
  }
  return directions;
}

// [signals][samples]: noise, smooth lobes, nearly constant.
Eigen::MatrixXd Signals(const Eigen::Matrix3Xd& directions, int count) {
  Rng rng(11);
  Eigen::MatrixXd signals(count, directions.cols());
  for (int s = 0; s < count; ++s) {
    const Eigen::Vector3d axis =
        Eigen::Vector3d(rng.NextDouble() - 0.5, rng.NextDouble() - 0.5, 0.2 + rng.NextDouble()).normalized();
    const double sharpness = 1.0 + 40.0 * rng.NextDouble();
    const double noise = s % 3 == 0 ? 1.0 : 0.02;
    for (int i = 0; i < directions.cols(); ++i) {
      const double cosine = std::max(0.0, axis.dot(directions.col(i)));
      signals(s, i) = 0.2 + std::pow(cosine, sharpness) + noise * rng.NextDouble();
    }
  }
  return signals;
}

Eigen::VectorXd Energies(const Eigen::MatrixXd& signals, double solid_angle) {
  return signals.rowwise().squaredNorm() * (solid_angle / static_cast<double>(signals.cols()));
}

// The paper's way: one factorisation for each trial lambda, bisection to the last bit, from `min_lambda` up.
Eigen::VectorXd BruteForce(const Eigen::MatrixXd& basis, const Eigen::VectorXd& f, double energy,
                           double min_lambda = 0.0) {
  const Eigen::MatrixXd a = basis.transpose() * basis;
  const Eigen::VectorXd b = basis.transpose() * f;
  const auto solve = [&](double lambda) -> Eigen::VectorXd {
    return (a + lambda * Eigen::MatrixXd::Identity(a.rows(), a.cols())).ldlt().solve(b);
  };
  if (solve(min_lambda).squaredNorm() <= energy) {
    return solve(min_lambda);
  }
  double low = min_lambda;
  double high = 1.0;
  while (solve(high).squaredNorm() > energy) {
    high *= 2.0;
  }
  for (int i = 0; i < 200; ++i) {
    const double middle = 0.5 * (low + high);
    (solve(middle).squaredNorm() > energy ? low : high) = middle;
  }
  return solve(high);
}

template <typename Scalar>
Eigen::MatrixXd Fit(const ClsSolver<Scalar>& solver, const Eigen::MatrixXd& signals,
                    const Eigen::VectorXd& energies) {
  const Eigen::Index padded = (signals.rows() + ClsSolver<Scalar>::kLanes - 1) / ClsSolver<Scalar>::kLanes *
                              ClsSolver<Scalar>::kLanes;
  typename ClsSolver<Scalar>::Matrix projected =
      ClsSolver<Scalar>::Matrix::Zero(padded, solver.num_unknowns());
  typename ClsSolver<Scalar>::Vector energy = ClsSolver<Scalar>::Vector::Zero(padded);
  projected.topRows(signals.rows()) = signals.template cast<Scalar>() * solver.projection().transpose();
  energy.head(signals.rows()) = energies.template cast<Scalar>();
  solver.Shrink(energy, projected);
  return (projected.topRows(signals.rows()) * solver.eigenvectors().transpose()).template cast<double>();
}

TEST(ConstrainedLeastSquaresTest, EqualsTheBruteForceSolver) {
  const Eigen::Matrix3Xd directions = Rings();
  const Eigen::MatrixXd signals = Signals(directions, 60);
  for (const int unknowns : {1, 4, 9, 16, 25, 36, 49}) {
    const Eigen::MatrixXd basis = ShMatrix(unknowns, directions);
    const double largest_eigenvalue = ClsSolver<double>(basis).eigenvalues().maxCoeff();
    for (const double solid_angle : {2.0 * kPi, 4.0 * kPi}) {
      const Eigen::VectorXd energies = Energies(signals, solid_angle);
      const Eigen::MatrixXd exact = Fit(ClsSolver<double>(basis), signals, energies);
      const Eigen::MatrixXd fast = Fit(ClsSolver<float>(basis), signals, energies);
      for (int s = 0; s < signals.rows(); ++s) {
        const Eigen::VectorXd expected = BruteForce(basis, signals.row(s).transpose(), energies[s]);
        EXPECT_LT((exact.row(s).transpose() - expected).norm(), 1e-8 * expected.norm())
            << unknowns << " unknowns, signal " << s;
        // Float keeps its lambda floor, and stops within its energy tolerance.
        const Eigen::VectorXd floored = BruteForce(basis, signals.row(s).transpose(), energies[s],
                                                   ClsSolver<float>::kLambdaFloor * largest_eigenvalue);
        EXPECT_LT((fast.row(s).transpose() - floored).norm(), 1e-3 * floored.norm())
            << unknowns << " unknowns, signal " << s;
      }
    }
  }
}

TEST(ConstrainedLeastSquaresTest, MeetsTheEnergyConstraint) {
  const Eigen::Matrix3Xd directions = Rings();
  const Eigen::MatrixXd signals = Signals(directions, 200);
  const Eigen::VectorXd energies = Energies(signals, 2.0 * kPi);
  const ClsSolver<float> solver(ShMatrix(25, directions));
  const Eigen::MatrixXd fit = Fit(solver, signals, energies);
  for (int s = 0; s < signals.rows(); ++s) {
    EXPECT_LE(fit.row(s).squaredNorm(), energies[s] * (1.0 + 3.0 * ClsSolver<float>::kEnergyTolerance));
  }
}

TEST(ConstrainedLeastSquaresTest, NormFallsMonotonicallyInLambda) {
  const ClsSolver<double> solver(ShMatrix(25, Rings()));
  const Eigen::VectorXd p = solver.projection() * Signals(Rings(), 1).row(0).transpose();
  double previous = std::numeric_limits<double>::infinity();
  for (double lambda = 1e-6; lambda < 1e4; lambda *= 1.5) {
    const double norm2 = (p.array() / (solver.eigenvalues().array() + lambda)).square().sum();
    EXPECT_LT(norm2, previous);
    previous = norm2;
  }
  // and so a smaller energy gives a smaller fit.
  const Eigen::MatrixXd signals = Signals(Rings(), 1);
  double last = 0.0;
  for (const double share : {0.0, 0.1, 0.5, 0.9, 1.0, 2.0}) {
    const double norm = Fit(solver, signals, share * Energies(signals, 2.0 * kPi)).norm();
    EXPECT_GE(norm, last);
    last = norm;
  }
}

TEST(ConstrainedLeastSquaresTest, RowsDoNotInfluenceEachOther) {
  const Eigen::Matrix3Xd directions = Rings();
  const Eigen::MatrixXd signals = Signals(directions, 32);
  const ClsSolver<float> solver(ShMatrix(25, directions));
  Eigen::MatrixXf together = (signals.cast<float>() * solver.projection().transpose()).eval();
  Eigen::MatrixXf reversed = together.colwise().reverse();
  const Eigen::VectorXf energies = Energies(signals, 2.0 * kPi).cast<float>();
  solver.Shrink(energies, together);
  solver.Shrink(energies.reverse().eval(), reversed);
  EXPECT_TRUE((together.array() == reversed.colwise().reverse().array()).all());
}

TEST(ConstrainedLeastSquaresTest, StaysFiniteWithoutLightAndWithTooFewDirections) {
  for (const int num_directions : {1, 2, 5, 24}) {
    const Eigen::Matrix3Xd directions = Rings().leftCols(num_directions);
    const ClsSolver<float> solver(ShMatrix(25, directions));
    Eigen::MatrixXd signals = Signals(directions, 6);
    signals.row(1).setZero();
    signals.row(2).setConstant(1.0);
    signals.row(3).setConstant(1e-30);
    signals.row(4).setConstant(1e12);
    const Eigen::MatrixXd fit = Fit(solver, signals, Energies(signals, 2.0 * kPi));
    EXPECT_TRUE(fit.allFinite()) << num_directions;
    EXPECT_EQ(fit.row(1).norm(), 0.0);
    // Where an energy of 4 pi leaves room, a constant is met at the directions there are.
    const Eigen::MatrixXd roomy = Fit(solver, signals, Energies(signals, 4.0 * kPi));
    const Eigen::VectorXd values = ShMatrix(25, directions) * roomy.row(2).transpose();
    EXPECT_LT((values.array() - 1.0).abs().maxCoeff(), 1e-3) << num_directions;
  }
}

}  // namespace
}  // namespace tessera
