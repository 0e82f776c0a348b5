#include "btf/codec/table_checks.h"

#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

namespace tessera {

absl::StatusOr<const CodecTable*> FindTable(const BtfelTable& table, const std::string& name,
                                            const std::vector<int64_t>& shape) {
  const auto found = table.tables.find(name);
  if (found == table.tables.end()) {
    return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "' is missing"));
  }
  const CodecTable& values = found->second;
  bool fits = values.shape.size() == shape.size();
  size_t size = 1;
  for (size_t i = 0; fits && i < shape.size(); ++i) {
    fits = shape[i] >= 0 ? values.shape[i] == shape[i] : values.shape[i] >= 1;
    fits = fits && !__builtin_mul_overflow(size, static_cast<size_t>(values.shape[i]), &size);
  }
  if (!fits || values.values.size() != size) {
    return absl::InvalidArgumentError(absl::StrCat("codec table '", name, "': ", values.values.size(),
                                                   " values of shape [", absl::StrJoin(values.shape, ", "),
                                                   "], expected [", absl::StrJoin(shape, ", "), "]"));
  }
  return &values;
}

absl::Status CheckDirections(const std::vector<Direction>& directions, const std::string& name,
                             size_t max_directions) {
  if (directions.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": there are none"));
  }
  if (directions.size() > max_directions) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": there are ", directions.size(), ", at most ", max_directions));
  }
  for (size_t i = 0; i < directions.size(); ++i) {
    // Directions that were stored as float32 may lie a rounding below the horizon.
    constexpr double kTolerance = 1e-4;
    if (!std::isfinite(directions[i].phi_rad) ||
        !(directions[i].theta_rad >= 0.0 && directions[i].theta_rad <= kPi / 2.0 + kTolerance)) {
      return absl::InvalidArgumentError(absl::StrCat(name, "[", i, "]: polar angle ",
                                                     DegFromRad(directions[i].theta_rad),
                                                     " degrees, expected 0 to 90"));
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
