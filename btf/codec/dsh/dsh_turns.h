// Quarter turns of dsh* BTFels on their coefficients: spherical harmonics of one degree l and of orders m and
// -m are turned into each other, so a turn is a signed permutation of coefficients, and exact.
#pragma once

#include <optional>

#include "btf/codec/btfel_table.h"
#include "btf/codec/codec.h"

namespace tessera {

// Of coefficients [(channel, j, i)] in kl light and kv view functions that turn as plain harmonics do: legal
// counts (math/spherical_harmonics.h); turns 0..3.
[[nodiscard]] CoefficientTurn MakeDshTurn(int kl, int kv, int turns);

// By turns 0..3; nothing where a basis table mixes functions that do not turn alike (those of all encoders
// here do). Errors: those of DshDecoder::Create.
[[nodiscard]] absl::StatusOr<std::optional<CoefficientTurns>> DshTurns(const BtfelTable& table);

}  // namespace tessera
