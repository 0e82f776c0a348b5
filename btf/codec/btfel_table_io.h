// BTFel tables in containers: the sections and header keys that materials and tile sets share (FORMAT.md).
//
//   Container c{.kind = "material"};
//   TESSERA_RETURN_IF_ERROR(AddSharedTables(table, c));
//   TESSERA_RETURN_IF_ERROR(AddCoefficients(table, {height, width}, c));
//   ...
//   TESSERA_ASSIGN_OR_RETURN(BtfelTable table, ReadSharedTables(c));
//   TESSERA_ASSIGN_OR_RETURN(auto extents, ReadCoefficients(c, /*rank=*/2, table));
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/container.h"

namespace tessera {

// Everything but the codes: header key `codec` {id, version, parameters, tables}, sections `offset`, `step`,
// `views`, `lights` and one section for each codec table, under its own name.
// Errors: INVALID_ARGUMENT naming what is misshapen, not finite, or a table whose name is taken.
[[nodiscard]] absl::Status AddSharedTables(const BtfelTable& table, Container& container);

// The reverse. The result has no codes yet. Errors: INVALID_ARGUMENT naming the section or key, or what of
// the tables does not fit the codec; UNIMPLEMENTED naming a codec or version that this library does not know.
[[nodiscard]] absl::StatusOr<BtfelTable> ReadSharedTables(const Container& container);

// Section `coefficients` u8 [extents..][k]; its bytes stay in `table`. Errors: INVALID_ARGUMENT when the
// codes do not fill the extents.
[[nodiscard]] absl::Status AddCoefficients(const BtfelTable& table, const std::vector<int64_t>& extents,
                                           Container& container);
// Sets table.codes from section `coefficients` and returns its `rank` leading extents, each >= 1.
[[nodiscard]] absl::StatusOr<std::vector<int64_t>> ReadCoefficients(const Container& container, size_t rank,
                                                                    BtfelTable& table);

// Sections `btfel_order` u32 [k] and `btfels.0` .. `btfels.3` u8 [n][k_i]: the coefficients in falling order
// of their energy (the sum of value^2 over the table, ties by index), split after about 1/8, 1/4 and 1/2 of
// them, so that a reader holding the first of these sections alone has a coarser table. Position p of the
// concatenated columns is coefficient btfel_order[p]. Fewer sections where there are fewer coefficients than
// parts.
[[nodiscard]] absl::Status AddCoefficientsByEnergy(const BtfelTable& table, Container& container);
// Sets table.codes, [n][k] in coefficient order. Errors: INVALID_ARGUMENT when the sections disagree in n,
// their columns do not add up to k, or `btfel_order` is not a permutation.
[[nodiscard]] absl::Status ReadCoefficientsByEnergy(const Container& container, BtfelTable& table);

// A section f32 [n][3] of unit vectors. Errors: INVALID_ARGUMENT naming the first direction that is not
// finite or points below the surface; also an empty section, ReadDirections.
[[nodiscard]] absl::Status AddDirections(std::string_view name, const std::vector<Direction>& directions,
                                         Container& container);
[[nodiscard]] absl::StatusOr<std::vector<Direction>> ReadDirections(std::string_view name,
                                                                    const Container& container);

// Header keys `source`, `licence`, `citation`.
void AddProvenance(const Provenance& provenance, Container& container);
// Absent keys read as "". Errors: INVALID_ARGUMENT when one is not a string.
[[nodiscard]] absl::StatusOr<Provenance> ReadProvenance(const Container& container);

}  // namespace tessera
