// Real orthonormal spherical harmonics without the Condon-Shortley sign, degrees 0 to 6.
//
//   y(l, m) = sqrt(2) K(l, m) P(l, m)(cos theta) cos(m phi)        m > 0
//             K(l, 0) P(l, 0)(cos theta)                            m = 0
//             sqrt(2) K(l, |m|) P(l, |m|)(cos theta) sin(|m| phi)   m < 0
//   K(l, m) = sqrt((2 l + 1) / (4 pi) * (l - m)! / (l + m)!),  P without (-1)^m,  index l (l + 1) + m
//
// so y1..y3 are sqrt(3 / (4 pi)) times y, z, x. Source: [Leung2007] 3.1 for their use; the recurrences are
// those of the fully normalised associated Legendre functions (Holmes and Featherstone 2002, J. Geodesy 76,
// eq. 11-13), divided by sin^m theta so that everything is a polynomial in x, y, z and the pole needs no
// care.
//
//   Eigen::MatrixXd basis = ShMatrix(/*num_functions=*/25, directions);   // [directions][25]
#pragma once

#include <array>
#include <span>

#include <Eigen/Core>

namespace tessera {

inline constexpr int kMaxShDegree = 6;
inline constexpr int kMaxShFunctions = (kMaxShDegree + 1) * (kMaxShDegree + 1);

// Whether `num_functions` is 1, 4, 9, 16, 25, 36 or 49: all functions up to some degree.
[[nodiscard]] bool IsShFunctionCount(int num_functions);

// The degree l of the last of `num_functions`, which must be a legal count.
[[nodiscard]] int ShDegree(int num_functions);

// values[l (l + 1) + m] = y(l, m)(direction) for the first values.size() functions, a legal count.
// `direction` is unit. Relative error below 1e-14. About 100 multiplications for 25 functions.
void EvaluateSh(const Eigen::Vector3d& direction, std::span<double> values);

// The same for many directions (columns, unit): [directions][num_functions], vectorised over directions.
[[nodiscard]] Eigen::MatrixXd ShMatrix(int num_functions, const Eigen::Matrix3Xd& directions);

// What `turns` quarter turns of a texel, counter-clockwise, do to the coefficients of one of its directional
// arguments: f'(w) = f(UnturnedFromTurned(w, turns)) has coefficients c'[i] = sign[i] * c[source[i]]. Exact.
struct ShQuarterTurns {
  std::array<int, kMaxShFunctions> source{};
  std::array<double, kMaxShFunctions> sign{};
};
[[nodiscard]] ShQuarterTurns MakeShQuarterTurns(int turns);

}  // namespace tessera
