// Which entries of a codec's tables belong to single coefficients: a reader that holds some coefficients
// needs these entries of them only. FORMAT.md, "Parts of a tile set", lists them.
//
//   TESSERA_ASSIGN_OR_RETURN(auto split, CoefficientTables::Of(table));
//   for (int64_t entry : split.EntriesOf("luma", coefficients)) { ... }
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"

namespace tessera {

// Immutable.
class CoefficientTables {
 public:
  // Of the codec's tables; those that are not listed for the codec, and all of an unknown codec, belong to no
  // coefficient. Errors: INVALID_ARGUMENT naming a table whose shape does not fit the number of coefficients.
  [[nodiscard]] static absl::StatusOr<CoefficientTables> Of(const BtfelTable& table);

  // Whether the table's entries belong to single coefficients.
  [[nodiscard]] bool IsSplit(const std::string& table) const { return rules_.contains(table); }
  // Whether a coefficient means nothing without entries of tables.
  [[nodiscard]] bool NeedsEntries(uint32_t coefficient) const;
  // The entries of a split table that belong to any of `coefficients` and to none of `before`, counted in
  // row-major order: those of the first coefficient, ascending, then those of the next that are not among
  // them. Both are below the number of coefficients.
  [[nodiscard]] std::vector<int64_t> EntriesOf(const std::string& table,
                                               std::span<const uint32_t> coefficients,
                                               std::span<const uint32_t> before) const;

 private:
  // Entry e lies in column (e / block) * width + e % width.
  struct Rule {
    int64_t size = 0;
    int64_t block = 0;
    int64_t width = 0;
    std::vector<int64_t> column_of;  // [coefficients], -1 for none
  };

  std::map<std::string, Rule> rules_;
};

}  // namespace tessera
