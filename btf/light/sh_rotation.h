// Rotation of real spherical harmonics (math/spherical_harmonics.h), block by block, from the 3 x 3 matrix
// alone: no angles, so no pole needs care.
//
//   M(R) is defined by  Y(R d) = M(R) Y(d)  for every direction d, R a rotation.
//   A function f(d) = sum of c_i Y_i(d), seen from a frame where directions read R d, has coefficients M(R)
//   c. M(R S) = M(R) M(S),  M(R)^T = M(R^T) = M(R)^-1.  Degree l is a block of 2 l + 1 rows; blocks do not
//   mix.
//
//   ShRotation rotation(local_from_world, /*degree=*/4);
//   rotation.Apply(world_coefficients, local_coefficients);   // [25] each
//
// Source: [Ivanic1996] with its corrections: block l from blocks 1 and l - 1, every element a sum of at most
// ten products.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

namespace tessera {

// Beyond it nothing is tested.
inline constexpr int kMaxShRotationDegree = 12;

// Immutable.
class ShRotation {
 public:
  // `rotation` is orthonormal with determinant 1, to about 1e-12: what it lacks comes back degree times as
  // large in the last block. degree in 0..kMaxShRotationDegree. About 9 multiplications an element: 4,000 for
  // degree 6.
  ShRotation(const Eigen::Matrix3d& rotation, int degree);

  [[nodiscard]] int degree() const { return degree_; }
  [[nodiscard]] int num_functions() const { return (degree_ + 1) * (degree_ + 1); }

  // Block `l`, [2 l + 1][2 l + 1], rows and columns by m = -l..l; 0 <= l <= degree().
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> Block(int l) const {
    return {blocks_.data() + BlockOffset(l), 2 * l + 1, 2 * l + 1};
  }
  // All blocks in their places, zeros between them, [num_functions][num_functions].
  [[nodiscard]] Eigen::MatrixXd Matrix() const;

  // The coefficients seen from the turned frame. Both are [n][columns], n the functions up to any degree not
  // above degree(). Each block by itself: for degree 6 a fifth of the dense product's multiplications.
  [[nodiscard]] Eigen::MatrixXd Apply(const Eigen::MatrixXd& coefficients) const;

 private:
  // The sum of (2 k + 1)^2 over k < l.
  [[nodiscard]] static int BlockOffset(int l) { return l * (4 * l * l - 1) / 3; }

  int degree_;
  std::vector<double> blocks_;  // column-major, one after another
};

}  // namespace tessera
