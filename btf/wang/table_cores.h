// Tables of a codec that have an entry for each view and each light, as few numbers: what layers bring of
// them (tile_set_layers.h; refine/core_coder.h makes it, FORMAT.md describes it).
//
// Such a table is V x L matrices of whole numbers. Matrix i is mean[i] + unit[i] * U^T core[i] W, with bases
// U [V'][V] and W [L'][L] that all matrices share: a Tucker decomposition [Tucker 1966]. Layers make the
// cores finer and finer.
//
//   CoreSum sum(AngularTablesOf(table, split), bases);
//   TESSERA_RETURN_IF_ERROR(sum.Add(/*step=*/0.01F, codes));
//   sum.Write(table.tables);
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/codec/coefficient_tables.h"

namespace tessera {

// Transforms take time with the cube of it.
inline constexpr size_t kMostAngularSide = 512;
inline constexpr size_t kMostAngularEntries = size_t{1} << 24;

// Table entry (before, view, light, after) lies at ((before * V + view) * L + light) * after_count + after.
struct AngularTable {
  std::string name;
  size_t before_count = 1;
  size_t after_count = 1;

  [[nodiscard]] size_t num_matrices() const { return before_count * after_count; }
};
// Those of u8 or u16 that belong to coefficients and have the views and lights as two extents that follow
// each other, by name; none of more than kMostAngularSide of either, or of more than kMostAngularEntries.
[[nodiscard]] std::vector<AngularTable> AngularTablesOf(const BtfelTable& table,
                                                        const CoefficientTables& split);

// One direction's base vectors, each with a step of its own: step * code.
struct AngularBasis {
  std::vector<float> step;     // [vectors], > 0
  std::vector<int32_t> codes;  // [vectors][directions]
};

struct CoreBases {
  std::vector<float> mean;  // [matrices], of table after table
  std::vector<float> unit;  // [matrices]
  AngularBasis view;
  AngularBasis light;
};

// Cores, added up. Not thread-safe.
class CoreSum {
 public:
  // Errors: INVALID_ARGUMENT naming the member, its value and the limit.
  [[nodiscard]] static absl::StatusOr<CoreSum> Create(const BtfelTable& table,
                                                      std::vector<AngularTable> tables, CoreBases bases);

  [[nodiscard]] const std::vector<AngularTable>& tables() const { return tables_; }
  // Of (view vector, light vector) pairs, by rising sum of the two, then by rising view vector.
  [[nodiscard]] size_t num_positions() const { return positions_.size(); }
  [[nodiscard]] size_t num_matrices() const { return bases_.mean.size(); }
  // [position][matrix], so far.
  [[nodiscard]] const std::vector<float>& cores() const { return cores_; }
  // [V'][V] and [L'][L].
  [[nodiscard]] const Eigen::MatrixXf& view_basis() const { return view_basis_; }
  [[nodiscard]] const Eigen::MatrixXf& light_basis() const { return light_basis_; }
  // [position]
  [[nodiscard]] const std::vector<std::pair<int, int>>& positions() const { return positions_; }

  // `codes` are [position][matrix] up to some position. Errors: INVALID_ARGUMENT naming the step, or the
  // number of codes.
  [[nodiscard]] absl::Status Add(float step, const std::vector<int32_t>& codes);
  // Sets the entries of these tables, whole numbers of their range.
  void Write(std::map<std::string, CodecTable>& tables) const;

 private:
  CoreSum() = default;

  std::vector<AngularTable> tables_;
  CoreBases bases_;
  Eigen::MatrixXf view_basis_;
  Eigen::MatrixXf light_basis_;
  std::vector<std::pair<int, int>> positions_;
  std::vector<float> cores_;
};

}  // namespace tessera
