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

}  // namespace tessera
