#include "btf/math/hemisphere_gram.h"

#include <cmath>

#include <gtest/gtest.h>

#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

TEST(GaussLegendreTest, IntegratesPolynomialsExactly) {
  for (const int n : {1, 2, 5, 8}) {
    const GaussLegendreRule rule = GaussLegendre(n);
    for (int power = 0; power <= 2 * n - 1; ++power) {
      const double integral = (rule.weights.array() * rule.nodes.array().pow(power)).sum();
      EXPECT_NEAR(integral, 1.0 / (power + 1), 1e-14) << n << " nodes, power " << power;
    }
  }
}

TEST(HemisphereGramTest, MatchesIntegralsByHand) {
  const HemisphereQuadrature q = MakeHemisphereQuadrature(2);
  const Eigen::MatrixXd gram = GramMatrix(ShMatrix(9, q.directions), q.weights);
  EXPECT_NEAR(gram(0, 0), 0.5, 1e-14);  // (1 / 4 pi) 2 pi
  EXPECT_NEAR(gram(0, 2), std::sqrt(3.0) / 4.0, 1e-14);
  EXPECT_NEAR(gram(1, 1), 0.5, 1e-14);  // equal parities in z: half of the sphere's
  EXPECT_NEAR(gram(0, 6), 0.0, 1e-14);
  EXPECT_NEAR(gram(0, 1), 0.0, 1e-14);
  EXPECT_NEAR(q.weights.sum(), 2.0 * kPi, 1e-13);
}

TEST(HemisphereGramTest, DoesNotDependOnTheRule) {
  // Were the rule not exact, a finer one would give another matrix.
  const HemisphereQuadrature coarse = MakeHemisphereQuadrature(6);
  const HemisphereQuadrature fine = MakeHemisphereQuadrature(20);
  const Eigen::MatrixXd difference = GramMatrix(ShMatrix(49, coarse.directions), coarse.weights) -
                                     GramMatrix(ShMatrix(49, fine.directions), fine.weights);
  EXPECT_LT(difference.cwiseAbs().maxCoeff(), 1e-13);
}

TEST(HemisphereGramTest, SplitCoversTheHemisphereOnce) {
  const HemisphereQuadrature q = MakeHemisphereQuadrature(4, RadFromDeg(75.0));
  EXPECT_NEAR(q.weights.sum(), 2.0 * kPi, 1e-13);
  // A function with a kink at 75 degrees: max(0, cos 75 - z).
  const double kink = std::cos(RadFromDeg(75.0));
  const double integral =
      (q.weights.array() * (kink - q.directions.row(2).transpose().array()).max(0.0)).sum();
  EXPECT_NEAR(integral, 2.0 * kPi * kink * kink / 2.0, 1e-13);
}

}  // namespace
}  // namespace tessera
