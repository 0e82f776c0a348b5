#include "btf/math/truncated_svd.h"

#include <cmath>

#include <gtest/gtest.h>
#include <Eigen/SVD>

#include "btf/base/rng.h"

namespace tessera {
namespace {

// rows x columns with singular values falling as 1 / (i + 1), the first `rank` of them.
Eigen::MatrixXd FallingMatrix(int rows, int columns, int rank, uint64_t seed) {
  Rng rng(seed);
  const auto random = [&rng](int r, int c) {
    Eigen::MatrixXd m(r, c);
    for (Eigen::Index i = 0; i < m.size(); ++i) {
      m.data()[i] = rng.NextDouble() - 0.5;
    }
    return Eigen::MatrixXd(m.householderQr().householderQ() * Eigen::MatrixXd::Identity(r, c));
  };
  Eigen::VectorXd values(rank);
  for (int i = 0; i < rank; ++i) {
    values[i] = 1.0 / (i + 1.0);
  }
  return random(rows, rank) * values.asDiagonal() * random(columns, rank).transpose();
}

BlockLanczos Iterated(const Eigen::MatrixXd& a, int block, int passes) {
  const Eigen::MatrixXf af = a.cast<float>();
  BlockLanczos lanczos(a.cols(), block, 1);
  for (int pass = 0; pass < passes && !lanczos.is_complete(); ++pass) {
    lanczos.Add(af.transpose() * (af * lanczos.block()));
  }
  return lanczos;
}

TEST(BlockLanczosTest, AgreesWithAFullDecomposition) {
  const Eigen::MatrixXd a = FallingMatrix(150, 90, 60, 3);
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinV);
  const SingularSpace leading = Iterated(a, 12, 4).Leading(12);
  ASSERT_EQ(leading.values.size(), 12);
  for (int i = 0; i < 12; ++i) {
    // The last ones have neighbours a twelfth away.
    EXPECT_NEAR(leading.values[i], svd.singularValues()[i], (i < 8 ? 1e-4 : 3e-3) * svd.singularValues()[i])
        << i;
  }
  // The best approximation of its rank, to a part in a thousand.
  const double best = std::sqrt(svd.singularValues().tail(svd.singularValues().size() - 12).squaredNorm());
  const double error = (a - a * leading.vectors * leading.vectors.transpose()).norm();
  EXPECT_GE(error, best * (1.0 - 1e-9));
  EXPECT_LE(error, best * (1.0 + 1e-3));
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(std::abs(leading.vectors.col(i).dot(svd.matrixV().col(i))), 1.0, 1e-4) << i;
  }
}

TEST(BlockLanczosTest, VectorsAreOrthonormalAndSigned) {
  const SingularSpace leading = Iterated(FallingMatrix(40, 70, 30, 5), 8, 3).Leading(20);
  const Eigen::MatrixXd gram = leading.vectors.transpose() * leading.vectors;
  EXPECT_LT((gram - Eigen::MatrixXd::Identity(20, 20)).cwiseAbs().maxCoeff(), 1e-5);
  for (Eigen::Index i = 0; i < 20; ++i) {
    EXPECT_GT(leading.vectors.col(i).maxCoeff(), -leading.vectors.col(i).minCoeff());
    EXPECT_TRUE(i == 0 || leading.values[i] <= leading.values[i - 1]);
  }
}

TEST(BlockLanczosTest, BeyondTheRankNothingIsLeft) {
  const SingularSpace leading = Iterated(FallingMatrix(50, 40, 5, 7), 12, 3).Leading(12);
  ASSERT_EQ(leading.values.size(), 12);
  EXPECT_NEAR(leading.values[4], 0.2, 1e-5);
  for (int i = 5; i < 12; ++i) {
    EXPECT_LT(leading.values[i], 1e-3) << i;
    EXPECT_TRUE(leading.vectors.col(i).allFinite());
  }
}

// Rows of three kinds, multiplied one after the other as an encoder sees them: what a pass adds beyond the
// kinds is rounding.
TEST(BlockLanczosTest, RoundingBeyondTheRankStaysOrthogonal) {
  constexpr int kSize = 360;
  constexpr int kBlock = 60;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    Rng rng(seed);
    Eigen::MatrixXf kinds(3, kSize);
    for (Eigen::Index i = 0; i < kinds.size(); ++i) {
      kinds.data()[i] = static_cast<float>(1.0 + rng.NextDouble() * static_cast<double>(i % 3));
    }
    Eigen::MatrixXf a(45, kSize);
    for (int row = 0; row < a.rows(); ++row) {
      a.row(row) = kinds.row(row * 7 % 3);
    }
    BlockLanczos lanczos(kSize, kBlock, 1);
    for (int pass = 0; pass < 3 && !lanczos.is_complete(); ++pass) {
      const Eigen::MatrixXf t = a * lanczos.block();
      Eigen::MatrixXf product = Eigen::MatrixXf::Zero(kSize, t.cols());
      for (int row = 0; row < a.rows(); ++row) {
        product.noalias() += a.row(row).transpose() * t.row(row);
      }
      lanczos.Add(product);
    }
    const SingularSpace leading = lanczos.Leading(kBlock);
    const Eigen::Index rank = leading.values.size();
    const Eigen::MatrixXd gram = leading.vectors.transpose() * leading.vectors;
    EXPECT_LT((gram - Eigen::MatrixXd::Identity(rank, rank)).cwiseAbs().maxCoeff(), 1e-5) << seed;
    const Eigen::VectorXd expected = Eigen::JacobiSVD<Eigen::MatrixXd>(a.cast<double>()).singularValues();
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(leading.values[i], expected[i], 1e-5 * expected[0]) << seed << " " << i;
    }
  }
}

TEST(BlockLanczosTest, TakesTheSmallestSpacesAndZero) {
  const SingularSpace one = Iterated(Eigen::MatrixXd::Constant(7, 1, 2.0), 5, 3).Leading(4);
  ASSERT_EQ(one.values.size(), 1);
  EXPECT_NEAR(one.values[0], 2.0 * std::sqrt(7.0), 1e-5);
  EXPECT_NEAR(one.vectors(0, 0), 1.0, 1e-6);
  const BlockLanczos zero = Iterated(Eigen::MatrixXd::Zero(9, 6), 4, 3);
  EXPECT_TRUE(zero.is_complete());
  EXPECT_EQ(zero.Leading(4).values.maxCoeff(), 0.0);
  EXPECT_TRUE(zero.Leading(4).vectors.allFinite());
  const BlockLanczos all = Iterated(FallingMatrix(20, 6, 6, 9), 4, 9);
  EXPECT_TRUE(all.is_complete());
  EXPECT_EQ(all.Leading(10).values.size(), 6);
}

}  // namespace
}  // namespace tessera
