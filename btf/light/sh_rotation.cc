#include "btf/light/sh_rotation.h"

#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>

namespace tessera {
namespace {

// The factors u, v and w of element (m, n) of block l, which do not depend on the rotation.
struct RecursionFactors {
  double u = 0.0;
  double v = 0.0;
  double w = 0.0;
};

RecursionFactors FactorsOf(int l, int m, int n) {
  const int a = std::abs(m);
  const double denominator = std::abs(n) < l ? (l + n) * (l - n) : 2 * l * (2 * l - 1);
  RecursionFactors factors;
  factors.u = std::sqrt((l + m) * (l - m) / denominator);
  factors.v = m == 0 ? -0.5 * std::sqrt(2.0 * (l - 1) * l / denominator)
                     : 0.5 * std::sqrt((l + a - 1) * (l + a) / denominator);
  factors.w = m == 0 ? 0.0 : -0.5 * std::sqrt((l - a - 1) * (l - a) / denominator);
  return factors;
}

// By (l, m, n) as blocks are stored.
const std::vector<RecursionFactors>& AllFactors() {
  static const std::vector<RecursionFactors> all = [] {
    std::vector<RecursionFactors> factors;
    for (int l = 0; l <= kMaxShRotationDegree; ++l) {
      for (int n = -l; n <= l; ++n) {
        for (int m = -l; m <= l; ++m) {
          factors.push_back(l < 2 ? RecursionFactors{} : FactorsOf(l, m, n));
        }
      }
    }
    return factors;
  }();
  return all;
}

// One step of the recursion: block l, l >= 2, from block 1 and block l - 1.
class BlockRecursion {
 public:
  BlockRecursion(int l, Eigen::Map<const Eigen::MatrixXd> first, Eigen::Map<const Eigen::MatrixXd> below)
      : l_(l), first_(std::move(first)), below_(std::move(below)) {}

  [[nodiscard]] double Element(int m, int n, const RecursionFactors& factors) const {
    double sum = 0.0;
    // Where a factor is 0, what it stands before does not exist.
    if (factors.u != 0.0) {
      sum += factors.u * P(0, m, n);
    }
    if (factors.v != 0.0) {
      sum += factors.v * V(m, n);
    }
    if (factors.w != 0.0) {
      sum += factors.w * W(m, n);
    }
    return sum;
  }

 private:
  [[nodiscard]] double First(int i, int j) const { return first_(i + 1, j + 1); }
  [[nodiscard]] double Below(int m, int n) const { return below_(m + l_ - 1, n + l_ - 1); }

  [[nodiscard]] double P(int i, int m, int n) const {
    if (n == l_) {
      return First(i, 1) * Below(m, l_ - 1) - First(i, -1) * Below(m, 1 - l_);
    }
    if (n == -l_) {
      return First(i, 1) * Below(m, 1 - l_) + First(i, -1) * Below(m, l_ - 1);
    }
    return First(i, 0) * Below(m, n);
  }

  [[nodiscard]] double V(int m, int n) const {
    constexpr double kSqrt2 = 1.4142135623730950488;
    if (m == 0) {
      return P(1, 1, n) + P(-1, -1, n);
    }
    if (m > 0) {
      return m == 1 ? kSqrt2 * P(1, 0, n) : P(1, m - 1, n) - P(-1, 1 - m, n);
    }
    return m == -1 ? kSqrt2 * P(-1, 0, n) : P(1, m + 1, n) + P(-1, -m - 1, n);
  }

  [[nodiscard]] double W(int m, int n) const {
    return m > 0 ? P(1, m + 1, n) + P(-1, -m - 1, n) : P(1, m - 1, n) - P(-1, 1 - m, n);
  }

  int l_;
  Eigen::Map<const Eigen::MatrixXd> first_;
  Eigen::Map<const Eigen::MatrixXd> below_;
};

}  // namespace

ShRotation::ShRotation(const Eigen::Matrix3d& rotation, int degree)
    : degree_(degree), blocks_(BlockOffset(degree + 1)) {
  assert(degree >= 0 && degree <= kMaxShRotationDegree);
  blocks_[0] = 1.0;
  if (degree == 0) {
    return;
  }
  // Functions -1, 0, 1 of degree 1 are y, z, x.
  constexpr std::array<int, 3> kAxis = {1, 2, 0};
  for (int n = 0; n < 3; ++n) {
    for (int m = 0; m < 3; ++m) {
      blocks_[BlockOffset(1) + 3 * n + m] = rotation(kAxis[m], kAxis[n]);
    }
  }
  for (int l = 2; l <= degree; ++l) {
    const BlockRecursion recursion(l, Block(1), Block(l - 1));
    int index = BlockOffset(l);
    for (int n = -l; n <= l; ++n) {
      for (int m = -l; m <= l; ++m, ++index) {
        blocks_[index] = recursion.Element(m, n, AllFactors()[index]);
      }
    }
  }
}

Eigen::MatrixXd ShRotation::Matrix() const {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(num_functions(), num_functions());
  for (int l = 0; l <= degree_; ++l) {
    matrix.block(l * l, l * l, 2 * l + 1, 2 * l + 1) = Block(l);
  }
  return matrix;
}

Eigen::MatrixXd ShRotation::Apply(const Eigen::MatrixXd& coefficients) const {
  assert(coefficients.rows() <= num_functions());
  Eigen::MatrixXd turned(coefficients.rows(), coefficients.cols());
  for (int l = 0; l * l < coefficients.rows(); ++l) {
    turned.middleRows(l * l, 2 * l + 1).noalias() =
        Block(l).lazyProduct(coefficients.middleRows(l * l, 2 * l + 1));
  }
  return turned;
}

}  // namespace tessera
