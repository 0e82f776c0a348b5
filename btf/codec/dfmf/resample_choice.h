// How the factors of a material are resampled between its measured directions (direction_grid.h): the rule
// that predicts directions best from the others, of a fixed list, for lights and views apart.
//
// A side's factors enter by their Gram matrix alone: with e_i the row of all factors at direction i, scaled
// by the singular values, and W the weights by which a rule predicts direction t from others, the squared
// error |e_t - W e|^2 over all texels is a quadratic form of G = e e^T. Every fifth direction is predicted
// from the rest, five times over, so a rule costs five small systems and no pass over the data. The rule
// changes from material to material: relief wants views compared where their rays meet the ground (on wool
// bend 0.9 takes 5% off the error on held-out views against 0.5), lights nearer to angles, noise a larger
// detail.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "btf/codec/dfmf/direction_grid.h"
#include "btf/codec/dfmf/sample_matrix.h"
#include "btf/math/conventions.h"

namespace tessera {

// Nodes along a side of the grid for so many directions: seven nodes for two of them. (On wool with every
// fifth direction held out, more gain less than a hundredth.)
[[nodiscard]] int ResampleNodesPerSide(size_t num_directions);

struct SideGrams {
  Eigen::MatrixXd light;  // [lights][lights]
  Eigen::MatrixXd view;   // [views][views]
};
[[nodiscard]] SideGrams MakeSideGrams(const Spaces& spaces, Eigen::Index num_views, Eigen::Index num_lights);

// `gram` is [directions][directions]. A fixed rule for fewer than kFewestJudged directions and for more than
// kMostJudged, where judging would take minutes. Deterministic; ties go to the rule first in the list.
inline constexpr size_t kFewestJudged = 10;
inline constexpr size_t kMostJudged = 512;
[[nodiscard]] ResampleRule ChooseResampleRule(const std::vector<Direction>& directions,
                                              const Eigen::MatrixXd& gram);

// What decodes at the measured directions from unit values there, [directions][directions].
[[nodiscard]] Eigen::MatrixXd Smoothing(const std::vector<Direction>& directions, const ResampleRule& rule);

}  // namespace tessera
