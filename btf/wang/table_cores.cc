#include "btf/wang/table_cores.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <absl/status/statusor.h>
#include <absl/strings/str_cat.h>

namespace tessera {
namespace {

absl::Status CheckBasis(const char* name, const AngularBasis& basis, size_t directions) {
  const bool steps_fit =
      std::ranges::all_of(basis.step, [](float s) { return std::isfinite(s) && s > 0.0F; });
  if (basis.step.size() > directions || basis.codes.size() != basis.step.size() * directions || !steps_fit) {
    return absl::InvalidArgumentError(absl::StrCat(
        name, ": ", basis.step.size(), " steps, ", basis.codes.size(),
        " codes, expected finite steps above 0 of at most ", directions, " vectors of ", directions));
  }
  return absl::OkStatus();
}

Eigen::MatrixXf MatrixOf(const AngularBasis& basis, size_t directions) {
  Eigen::MatrixXf matrix(static_cast<Eigen::Index>(basis.step.size()), static_cast<Eigen::Index>(directions));
  for (size_t i = 0; i < basis.codes.size(); ++i) {
    matrix(static_cast<Eigen::Index>(i / directions), static_cast<Eigen::Index>(i % directions)) =
        basis.step[i / directions] * static_cast<float>(basis.codes[i]);
  }
  return matrix;
}

}  // namespace

std::vector<AngularTable> AngularTablesOf(const BtfelTable& table, const CoefficientTables& split) {
  std::vector<AngularTable> angular;
  const auto views = static_cast<int64_t>(table.views.size());
  const auto lights = static_cast<int64_t>(table.lights.size());
  if (views == 0 || lights == 0 || std::cmp_greater(std::max(views, lights), kMostAngularSide)) {
    return angular;
  }
  for (const auto& [name, codec_table] : table.tables) {
    const std::vector<int64_t>& shape = codec_table.shape;
    if (!split.IsSplit(name) || codec_table.dtype == DType::kF32 || codec_table.values.empty() ||
        codec_table.values.size() > kMostAngularEntries) {
      continue;
    }
    for (size_t d = 0; d + 1 < shape.size(); ++d) {
      if (shape[d] == views && shape[d + 1] == lights) {
        AngularTable found{.name = name};
        for (size_t i = 0; i < shape.size(); ++i) {
          (i < d ? found.before_count : found.after_count) *=
              i == d || i == d + 1 ? size_t{1} : static_cast<size_t>(shape[i]);
        }
        angular.push_back(std::move(found));
        break;
      }
    }
  }
  return angular;
}

absl::StatusOr<CoreSum> CoreSum::Create(const BtfelTable& table, std::vector<AngularTable> tables,
                                        CoreBases bases) {
  size_t matrices = 0;
  for (const AngularTable& each : tables) {
    matrices += each.num_matrices();
  }
  const auto is_finite = [](float value) { return std::isfinite(value); };
  if (bases.mean.size() != matrices || bases.unit.size() != matrices ||
      !std::ranges::all_of(bases.mean, is_finite) || !std::ranges::all_of(bases.unit, is_finite)) {
    return absl::InvalidArgumentError(absl::StrCat("cores: ", bases.mean.size(), " means, ",
                                                   bases.unit.size(), " units, expected ", matrices,
                                                   " finite ones"));
  }
  if (absl::Status s = CheckBasis("view_basis", bases.view, table.views.size()); !s.ok()) {
    return s;
  }
  if (absl::Status s = CheckBasis("light_basis", bases.light, table.lights.size()); !s.ok()) {
    return s;
  }
  CoreSum sum;
  sum.tables_ = std::move(tables);
  sum.view_basis_ = MatrixOf(bases.view, table.views.size());
  sum.light_basis_ = MatrixOf(bases.light, table.lights.size());
  for (int a = 0; a < sum.view_basis_.rows(); ++a) {
    for (int b = 0; b < sum.light_basis_.rows(); ++b) {
      sum.positions_.emplace_back(a, b);
    }
  }
  std::ranges::stable_sort(sum.positions_, {}, [](const auto& at) { return at.first + at.second; });
  sum.cores_.assign(sum.positions_.size() * matrices, 0.0F);
  sum.bases_ = std::move(bases);
  return sum;
}

absl::Status CoreSum::Add(float step, const std::vector<int32_t>& codes) {
  if (!std::isfinite(step) || step <= 0.0F || codes.size() > cores_.size()) {
    return absl::InvalidArgumentError(absl::StrCat("cores: step ", step, ", expected above 0, and ",
                                                   codes.size(), " codes, at most ", cores_.size()));
  }
  for (size_t i = 0; i < codes.size(); ++i) {
    cores_[i] += step * static_cast<float>(codes[i]);
  }
  return absl::OkStatus();
}

void CoreSum::Write(std::map<std::string, CodecTable>& tables) const {
  const auto views = static_cast<size_t>(view_basis_.cols());
  const auto lights = static_cast<size_t>(light_basis_.cols());
  size_t matrix = 0;
  Eigen::MatrixXf core(view_basis_.rows(), light_basis_.rows());
  for (const AngularTable& table : tables_) {
    CodecTable& to = tables.at(table.name);
    const float most = to.dtype == DType::kU8 ? std::numeric_limits<uint8_t>::max()
                                              : static_cast<float>(std::numeric_limits<uint16_t>::max());
    for (size_t i = 0; i < table.num_matrices(); ++i, ++matrix) {
      for (size_t at = 0; at < positions_.size(); ++at) {
        core(positions_[at].first, positions_[at].second) = cores_[at * num_matrices() + matrix];
      }
      const Eigen::MatrixXf values = view_basis_.transpose() * core * light_basis_;
      const size_t before = i / table.after_count;
      const size_t after = i % table.after_count;
      for (size_t view = 0; view < views; ++view) {
        for (size_t light = 0; light < lights; ++light) {
          const float value =
              bases_.mean[matrix] +
              bases_.unit[matrix] * values(static_cast<Eigen::Index>(view), static_cast<Eigen::Index>(light));
          // Not a number, of cores beyond all bounds, becomes 0.
          to.values[((before * views + view) * lights + light) * table.after_count + after] =
              value > 0.0F ? std::min(std::round(value), most) : 0.0F;
        }
      }
    }
  }
}

}  // namespace tessera
