// The choice of how factors are resampled, on signals whose nature is known.
#include "btf/codec/dfmf/resample_choice.h"

#include <cmath>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/data/direction_sets.h"

namespace tessera {
namespace {

// Gram matrix of signals whose covariance is that of the rule: no other predicts them as well.
Eigen::MatrixXd SignalsOf(const std::vector<Direction>& directions, const ResampleRule& rule) {
  const Eigen::Index m = static_cast<Eigen::Index>(directions.size());
  Eigen::MatrixXd gram(m, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j < m; ++j) {
      const Eigen::Vector2d apart = BentPoint(VectorFromDirection(directions[i]), rule.bend) -
                                    BentPoint(VectorFromDirection(directions[j]), rule.bend);
      gram(i, j) = ResampleCovariance(apart.norm(), rule);
    }
  }
  return gram;
}

TEST(ResampleChoiceTest, FindsTheBendOfTheSignal) {
  const std::vector<Direction> directions = *DirectionSet("ubo81");
  for (const double bend : {0.3, 0.5, 0.7, 0.9}) {
    const ResampleRule rule =
        ChooseResampleRule(directions, SignalsOf(directions, {.bend = bend, .range = 1.0, .detail = 0.01}));
    EXPECT_EQ(rule.bend, bend);
  }
}

TEST(ResampleChoiceTest, FindsHowMuchDirectionsHaveForThemselves) {
  const std::vector<Direction> directions = *DirectionSet("ubo81");
  const auto choice = [&](double detail) {
    return ChooseResampleRule(directions,
                              SignalsOf(directions, {.bend = 0.5, .range = 2.0, .detail = detail}));
  };
  const ResampleRule much = choice(0.3);
  EXPECT_GT(much.detail, choice(0.003).detail);
  // And yet what was measured decodes as measured.
  const Eigen::MatrixXd smoothing = Smoothing(directions, much);
  EXPECT_LT((smoothing - Eigen::MatrixXd::Identity(81, 81)).rowwise().norm().maxCoeff(), 0.1);
}

TEST(ResampleChoiceTest, FewAndBlackDirectionsHaveARule) {
  for (const size_t count : {1, 2, 9, 30}) {
    const std::vector<Direction> directions(count, Direction{0.3, 1.0});
    const ResampleRule rule = ChooseResampleRule(
        directions,
        Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(count)));
    EXPECT_TRUE(CheckResampleRule(rule).ok()) << count;
    EXPECT_TRUE(Smoothing(directions, rule).allFinite()) << count;
  }
}

}  // namespace
}  // namespace tessera
