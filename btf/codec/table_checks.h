// What decoders refuse of a BTFel table: codec tables of another shape, directions that none can be.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"

namespace tessera {

// The codec table `name`, of the given shape; -1 stands for any extent of at least 1. INVALID_ARGUMENT naming
// it and both shapes.
[[nodiscard]] absl::StatusOr<const CodecTable*> FindTable(const BtfelTable& table, const std::string& name,
                                                          const std::vector<int64_t>& shape);

// Errors: INVALID_ARGUMENT naming the set `name` that is empty or larger than `max_directions`, or its first
// direction that is not finite or below the horizon.
[[nodiscard]] absl::Status CheckDirections(const std::vector<Direction>& directions, const std::string& name,
                                           size_t max_directions = std::numeric_limits<size_t>::max());

}  // namespace tessera
