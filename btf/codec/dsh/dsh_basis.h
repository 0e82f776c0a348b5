// Spherical harmonics orthonormalised over the hemisphere, for the codec "dsh".
//
// Harmonics are orthonormal on the sphere, nearly dependent on the hemisphere (the condition number of 25 of
// them is 4e6), so that plain least squares needs coefficients of 5e4 for reflectances of 1. With G = L L^T
// the Gram matrix over the hemisphere of the functions as they decode (clamped beyond the largest measured
// polar angle, light weights scaled by the cosine: codec/FORMAT.md), the functions y' = L^-1 y are
// orthonormal there: coefficients are as large as the reflectance, the sum of their squares is its integral
// squared, and an error of one step in any of them does the same little harm.
//
// G couples functions of one order m only, and those of m and -m alike, so y' turn by quarters as y do.
#pragma once

#include <Eigen/Core>

#include "btf/math/conventions.h"

namespace tessera {

enum class DshArgument { kLight, kView };

// Relative to the largest integral of a y^2: functions with less energy left after those before them are not
// scaled up to 1, since float32 tables could not hold them (few directions near the normal make such).
inline constexpr double kDshGramFloor = 1e-10;

// B with y' = B y, [n][n], lower triangular, rounded to float32 as the table stores it; n a legal count,
// max_theta_rad in [0, pi/2]. Entries between functions of different order are exactly 0, those of m and -m
// exactly equal.
[[nodiscard]] Eigen::MatrixXd OrthonormalDshBasis(int n, DshArgument argument, double max_theta_rad);

// How much more than its size a function's roughness weighs, below.
inline constexpr double kDshRoughness = 0.1;

// What a fit in the functions y' = B y is penalised by, R [n][n] with
//
//   c^T R c = |c|^2 + kDshRoughness * integral over the hemisphere of (Laplacian of sum of c_i y'_i)^2,
//
// so that of all functions that pass near the samples the smoothest is taken: where rings of directions lie
// further apart than the functions swing, the smallest one would be black in between. As the Laplacian of
// Y(l, m) is -l (l + 1) Y(l, m), with D = diag(l (l + 1)) and G the harmonics' Gram matrix over the
// hemisphere R = I + kDshRoughness B D G D B^T. `basis` is OrthonormalDshBasis's. Symmetric, positive
// definite.
[[nodiscard]] Eigen::MatrixXd DshPenalty(const Eigen::MatrixXd& basis);

}  // namespace tessera
