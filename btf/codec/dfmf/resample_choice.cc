#include "btf/codec/dfmf/resample_choice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>

#include "btf/math/hemisphere_gram.h"
#include "btf/math/max_theta.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

constexpr int kFolds = 5;

// A trend of a quarter as many functions as directions at most; a range of about eight directions, and
// details that end before the next one.
ResampleRule RuleFor(size_t num_directions) {
  const double count = static_cast<double>(num_directions);
  ResampleRule rule;
  rule.trend = count >= 64 ? 16 : count >= 36 ? 9 : count >= 16 ? 4 : 1;
  rule.range = std::clamp(18.0 / std::sqrt(count), 0.1, 4.0);
  rule.detail_range = std::clamp(1.35 / std::sqrt(count), 0.03, 0.5);
  return rule;
}

// One part of the directions predicted from the rest.
struct Fold {
  std::vector<Eigen::Index> known;
  std::vector<Eigen::Index> asked;
  Eigen::MatrixXd trend;  // [asked][known]
  Eigen::MatrixXd left;   // what the trend leaves at the known ones, [known][known]
};

std::vector<Fold> MakeFolds(const std::vector<Direction>& directions, const ResampleRule& rule) {
  Eigen::Matrix3Xd vectors(3, directions.size());
  for (size_t i = 0; i < directions.size(); ++i) {
    vectors.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(directions[i]);
  }
  const Eigen::MatrixXd harmonics = ShMatrix(rule.trend, vectors);
  const HemisphereQuadrature quadrature = MakeHemisphereQuadrature(ShDegree(rule.trend));
  const Eigen::MatrixXd gram = GramMatrix(ShMatrix(rule.trend, quadrature.directions), quadrature.weights);
  std::vector<Fold> folds(kFolds);
  for (int f = 0; f < kFolds; ++f) {
    Fold& fold = folds[f];
    for (Eigen::Index i = 0; i < harmonics.rows(); ++i) {
      (i % kFolds == f ? fold.asked : fold.known).push_back(i);
    }
    const Eigen::MatrixXd y = harmonics(fold.known, Eigen::all);
    const double ridge = rule.ridge * static_cast<double>(y.rows()) / (2.0 * kPi);
    const Eigen::MatrixXd fit = (y.transpose() * y + ridge * gram).llt().solve(y.transpose());
    fold.trend = harmonics(fold.asked, Eigen::all) * fit;
    fold.left = Eigen::MatrixXd::Identity(y.rows(), y.rows()) - y * fit;
  }
  return folds;
}

// The squared error of all predictions. Values of the directions themselves stand for those of the grid.
double PredictionError(const std::vector<Direction>& directions, const std::vector<Fold>& folds,
                       const Eigen::MatrixXd& gram, const ResampleRule& rule) {
  const Eigen::Index m = gram.rows();
  Eigen::Matrix2Xd points(2, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    points.col(i) = BentPoint(VectorFromDirection(directions[i]), rule.bend);
  }
  Eigen::MatrixXd covariance(m, m);
  for (Eigen::Index i = 0; i < m; ++i) {
    for (Eigen::Index j = 0; j <= i; ++j) {
      covariance(i, j) = covariance(j, i) = ResampleCovariance((points.col(i) - points.col(j)).norm(), rule);
    }
  }
  double error = 0.0;
  for (const Fold& fold : folds) {
    Eigen::MatrixXd system = covariance(fold.known, fold.known);
    system.diagonal().array() += rule.nugget;
    const Eigen::MatrixXd weights =
        fold.trend + system.llt().solve(covariance(fold.known, fold.asked)).transpose() * fold.left;
    const Eigen::MatrixXd cross = gram(fold.asked, fold.known);
    error += gram.diagonal()(fold.asked).sum() - 2.0 * weights.cwiseProduct(cross).sum() +
             (weights * gram(fold.known, fold.known)).cwiseProduct(weights).sum();
  }
  return error;
}

}  // namespace

int ResampleNodesPerSide(size_t num_directions) {
  int n = 5;
  while (n < 25 && static_cast<size_t>(2 * n) * n < 7 * num_directions) {
    n += 2;
  }
  return n;
}

SideGrams MakeSideGrams(const Spaces& spaces, Eigen::Index num_views, Eigen::Index num_lights) {
  SideGrams grams{Eigen::MatrixXd::Zero(num_lights, num_lights), Eigen::MatrixXd::Zero(num_views, num_views)};
  for (const SingularSpace* const space : {&spaces.luma, &spaces.chroma}) {
    for (Eigen::Index k = 0; k < space->values.size(); ++k) {
      const double energy = space->values[k] * space->values[k];
      for (Eigen::Index begin = 0; begin < space->vectors.rows(); begin += num_views * num_lights) {
        const Eigen::Map<const Eigen::MatrixXd> v(space->vectors.col(k).data() + begin, num_lights,
                                                  num_views);
        grams.light += energy * v * v.transpose();
        grams.view += energy * v.transpose() * v;
      }
    }
  }
  return grams;
}

ResampleRule ChooseResampleRule(const std::vector<Direction>& directions, const Eigen::MatrixXd& gram) {
  const ResampleRule fixed = RuleFor(directions.size());
  if (directions.size() < kFewestJudged || directions.size() > kMostJudged) {
    return fixed;
  }
  const std::vector<Fold> folds = MakeFolds(directions, fixed);
  ResampleRule best = fixed;
  double least = PredictionError(directions, folds, gram, best);
  for (const double bend : {0.3, 0.5, 0.7, kMaxBend}) {
    for (const double range : {0.25, 0.5, 1.0, 2.0}) {
      for (const double detail : {0.003, 0.01, 0.03, 0.1, 0.3}) {
        ResampleRule rule = fixed;
        rule.bend = bend;
        rule.range *= range;
        rule.detail = detail;
        const double error = PredictionError(directions, folds, gram, rule);
        if (error < least) {
          least = error;
          best = rule;
        }
      }
    }
  }
  return best;
}

Eigen::MatrixXd Smoothing(const std::vector<Direction>& directions, const ResampleRule& rule) {
  const DirectionGrid grid(MaxThetaRad(directions), ResampleNodesPerSide(directions.size()));
  const Eigen::MatrixXd resample = ResampleMatrix(grid, directions, rule);
  Eigen::MatrixXd smoothing(resample.cols(), resample.cols());
  for (Eigen::Index i = 0; i < smoothing.rows(); ++i) {
    const DirectionGrid::Stencil at = grid.Find(VectorFromDirection(directions[i]));
    smoothing.row(i) = at.weights[0] * resample.row(at.nodes[0]) + at.weights[1] * resample.row(at.nodes[1]) +
                       at.weights[2] * resample.row(at.nodes[2]);
  }
  return smoothing;
}

}  // namespace tessera
