#include "btf/math/spherical_harmonics.h"

#include <cassert>
#include <cmath>

#include "btf/math/conventions.h"

namespace tessera {
namespace {

// Coefficients of the recurrences, q(l, m) = K(l, m) P(l, m) / sin^m theta:
//   q(m, m) = diagonal[m],  q(m + 1, m) = sqrt(2 m + 3) z q(m, m),
//   q(l, m) = a[l][m] (z q(l - 1, m) - b[l][m] q(l - 2, m)).
// For m > 0 the factor sqrt(2) of the real functions is taken into the diagonal.
struct Recurrence {
  std::array<double, kMaxShDegree + 1> diagonal{};
  std::array<std::array<double, kMaxShDegree + 1>, kMaxShDegree + 1> a{};
  std::array<std::array<double, kMaxShDegree + 1>, kMaxShDegree + 1> b{};

  Recurrence() {
    double product = std::sqrt(1.0 / (4.0 * kPi));
    for (int m = 0; m <= kMaxShDegree; ++m) {
      if (m > 0) {
        product *= std::sqrt((2.0 * m + 1.0) / (2.0 * m));
      }
      diagonal[m] = m == 0 ? product : std::sqrt(2.0) * product;
      for (int l = m + 1; l <= kMaxShDegree; ++l) {
        const double below = l - 1.0;
        a[l][m] = std::sqrt((4.0 * l * l - 1.0) / (static_cast<double>(l) * l - m * m));
        b[l][m] = std::sqrt((below * below - m * m) / (4.0 * below * below - 1.0));
      }
    }
  }
};

const Recurrence& GetRecurrence() {
  static const Recurrence recurrence;
  return recurrence;
}

// Runs the recurrences over `Value`s: double for one direction, an array for many. store(index, value)
// receives each function.
template <typename Value, typename Store>
void Evaluate(int degree, const Value& x, const Value& y, const Value& z, const Value& one, Store&& store) {
  const Recurrence& r = GetRecurrence();
  Value cos_m = one;        // sin^m theta cos(m phi)
  Value sin_m = one - one;  // sin^m theta sin(m phi)
  for (int m = 0; m <= degree; ++m) {
    Value q = one * r.diagonal[m];
    Value q_below = one - one;
    for (int l = m; l <= degree; ++l) {
      if (l > m) {
        // b(m + 1, m) is 0, so the first step needs no case of its own.
        const Value next = (z * q - q_below * r.b[l][m]) * r.a[l][m];
        q_below = q;
        q = next;
      }
      if (m == 0) {
        store(l * (l + 1), q);
      } else {
        store(l * (l + 1) + m, Value(q * cos_m));
        store(l * (l + 1) - m, Value(q * sin_m));
      }
    }
    const Value next_cos = x * cos_m - y * sin_m;
    sin_m = x * sin_m + y * cos_m;
    cos_m = next_cos;
  }
}

}  // namespace

bool IsShFunctionCount(int num_functions) {
  for (int degree = 0; degree <= kMaxShDegree; ++degree) {
    if (num_functions == (degree + 1) * (degree + 1)) {
      return true;
    }
  }
  return false;
}

int ShDegree(int num_functions) {
  assert(IsShFunctionCount(num_functions));
  int degree = 0;
  while ((degree + 1) * (degree + 1) < num_functions) {
    ++degree;
  }
  return degree;
}

void EvaluateSh(const Eigen::Vector3d& direction, std::span<double> values) {
  Evaluate<double>(ShDegree(static_cast<int>(values.size())), direction.x(), direction.y(), direction.z(),
                   1.0, [&](int index, double value) { values[index] = value; });
}

Eigen::MatrixXd ShMatrix(int num_functions, const Eigen::Matrix3Xd& directions) {
  Eigen::MatrixXd basis(directions.cols(), num_functions);
  const Eigen::ArrayXd x = directions.row(0).transpose().array();
  const Eigen::ArrayXd y = directions.row(1).transpose().array();
  const Eigen::ArrayXd z = directions.row(2).transpose().array();
  const Eigen::ArrayXd one = Eigen::ArrayXd::Ones(directions.cols());
  Evaluate<Eigen::ArrayXd>(
      ShDegree(num_functions), x, y, z, one,
      [&](int index, const Eigen::ArrayXd& value) { basis.col(index) = value.matrix(); });
  return basis;
}

ShQuarterTurns MakeShQuarterTurns(int turns) {
  // UnturnedFromTurned takes 90 degrees from the azimuth at every turn. With a = turns * 90 degrees,
  // cos(m (phi - a)) = cos(m a) cos(m phi) + sin(m a) sin(m phi), and the sine likewise.
  constexpr std::array<int, 4> kCos = {1, 0, -1, 0};
  constexpr std::array<int, 4> kSin = {0, 1, 0, -1};
  ShQuarterTurns result;
  for (int l = 0; l <= kMaxShDegree; ++l) {
    for (int m = 0; m <= l; ++m) {
      const int plus = l * (l + 1) + m;
      const int minus = l * (l + 1) - m;
      const int quarter = (m * (turns & 3)) & 3;
      if (kSin[quarter] == 0) {
        result.source[plus] = plus;
        result.source[minus] = minus;
        result.sign[plus] = result.sign[minus] = kCos[quarter];
      } else {
        result.source[plus] = minus;
        result.source[minus] = plus;
        result.sign[plus] = -kSin[quarter];
        result.sign[minus] = kSin[quarter];
      }
    }
  }
  return result;
}

}  // namespace tessera
