#include "btf/refine/core_coder.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

// In reflectance: what the rounding of the bases costs, and what base vectors that are left out have.
constexpr double kBasisRmse = 0.001;
constexpr double kLargestBasisStep = 1.0 / 32.0;
constexpr double kDeadZone = 0.1;
constexpr double kRidge = 1e-9;

// The eigenvectors of a sum of squares, most of it first, rounded. `entries`: numbers of a matrix.
AngularBasis BasisOf(const Eigen::MatrixXd& squares, double entries) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(squares);
  const Eigen::Index n = squares.rows();
  AngularBasis basis;
  double left = 0.0;  // of the mean square error, in vectors not kept
  Eigen::Index first = 0;
  while (first < n &&
         left + std::max(solver.eigenvalues()[first], 0.0) / entries <= kBasisRmse * kBasisRmse) {
    left += std::max(solver.eigenvalues()[first++], 0.0) / entries;
  }
  for (Eigen::Index i = n - 1; i >= first; --i) {
    // A vector's error is spread over n numbers, and those of all vectors add up.
    const double share = kBasisRmse * kBasisRmse / static_cast<double>(n - first);
    const double step =
        std::min(std::sqrt(12.0 * share * entries / (solver.eigenvalues()[i] * static_cast<double>(n))),
                 kLargestBasisStep);
    basis.step.push_back(static_cast<float>(step));
    for (Eigen::Index j = 0; j < n; ++j) {
      basis.codes.push_back(static_cast<int32_t>(std::lround(solver.eigenvectors()(j, i) / step)));
    }
  }
  return basis;
}

// [rows][columns]: times a matrix, its coordinates in the basis [rows][columns].
Eigen::MatrixXd InverseOf(const Eigen::MatrixXf& basis) {
  const Eigen::MatrixXd vectors = basis.cast<double>();
  Eigen::MatrixXd gram = vectors * vectors.transpose();
  gram.diagonal().array() += kRidge;
  return gram.ldlt().solve(vectors);
}

}  // namespace

int32_t CodeOf(double value, double step) {
  return static_cast<int32_t>(std::copysign(std::floor(std::abs(value) / step + 0.5 - kDeadZone), value));
}

absl::StatusOr<CoreCoder> CoreCoder::Create(const BtfelTable& table, std::vector<AngularTable> tables,
                                            const std::vector<double>& costs) {
  const auto views = static_cast<Eigen::Index>(table.views.size());
  const auto lights = static_cast<Eigen::Index>(table.lights.size());
  CoreBases bases;
  std::vector<Eigen::MatrixXd> matrices;  // by what they cost, their means taken off
  for (const AngularTable& each : tables) {
    const std::vector<float>& values = table.tables.at(each.name).values;
    for (size_t i = 0; i < each.num_matrices(); ++i) {
      Eigen::MatrixXd matrix(views, lights);
      for (Eigen::Index at = 0; at < views * lights; ++at) {
        const size_t cell =
            i / each.after_count * static_cast<size_t>(views * lights) + static_cast<size_t>(at);
        matrix(at / lights, at % lights) = values[cell * each.after_count + i % each.after_count];
      }
      const double cost = costs[matrices.size()];
      bases.mean.push_back(static_cast<float>(matrix.mean()));
      bases.unit.push_back(cost > 0.0 ? static_cast<float>(1.0 / cost) : 0.0F);
      matrices.emplace_back(cost * (matrix.array() - static_cast<double>(bases.mean.back())));
    }
  }
  Eigen::MatrixXd of_views = Eigen::MatrixXd::Zero(views, views);
  Eigen::MatrixXd of_lights = Eigen::MatrixXd::Zero(lights, lights);
  for (const Eigen::MatrixXd& matrix : matrices) {
    of_views += matrix * matrix.transpose();
    of_lights += matrix.transpose() * matrix;
  }
  bases.view = BasisOf(of_views, static_cast<double>(views * lights));
  bases.light = BasisOf(of_lights, static_cast<double>(views * lights));
  TESSERA_ASSIGN_OR_RETURN(CoreSum sum, CoreSum::Create(table, std::move(tables), bases));
  CoreCoder coder(std::move(sum), std::move(bases));
  const Eigen::MatrixXd view_inverse = InverseOf(coder.sum_.view_basis());
  const Eigen::MatrixXd light_inverse = InverseOf(coder.sum_.light_basis());
  coder.wanted_.resize(coder.sum_.cores().size());
  for (size_t i = 0; i < matrices.size(); ++i) {
    const Eigen::MatrixXd core = view_inverse * matrices[i] * light_inverse.transpose();
    for (size_t at = 0; at < coder.sum_.num_positions(); ++at) {
      const auto [a, b] = coder.sum_.positions()[at];
      coder.wanted_[at * matrices.size() + i] = static_cast<float>(core(a, b));
    }
  }
  return coder;
}

std::vector<int32_t> CoreCoder::Finer(float step) {
  std::vector<int32_t> codes;
  size_t end = 0;
  for (size_t i = 0; i < wanted_.size(); ++i) {
    codes.push_back(CodeOf(static_cast<double>(wanted_[i]) - sum_.cores()[i], step));
    end = codes.back() != 0 ? i + 1 : end;
  }
  codes.resize(end);
  (void)sum_.Add(step, codes);  // a step above 0, and no more codes than there are
  return codes;
}

}  // namespace tessera
