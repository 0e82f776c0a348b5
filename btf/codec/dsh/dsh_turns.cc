#include "btf/codec/dsh/dsh_turns.h"

#include <memory>

#include "btf/base/status_macros.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

// Whether y' = basis y turn by quarters as y do: basis R = R basis for the signed permutation R.
bool TurnsAsHarmonicsDo(const Eigen::MatrixXd& basis) {
  const ShQuarterTurns turn = MakeShQuarterTurns(1);
  for (Eigen::Index i = 0; i < basis.rows(); ++i) {
    for (Eigen::Index j = 0; j < basis.cols(); ++j) {
      if (turn.sign[i] * basis(turn.source[i], turn.source[j]) != basis(i, j) * turn.sign[j]) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace

CoefficientTurn MakeDshTurn(int kl, int kv, int turns) {
  const ShQuarterTurns q = MakeShQuarterTurns(turns);
  CoefficientTurn turn;
  for (int channel = 0; channel < 3; ++channel) {
    for (int j = 0; j < kv; ++j) {
      for (int i = 0; i < kl; ++i) {
        turn.source.push_back((channel * kv + q.source[j]) * kl + q.source[i]);
        turn.sign.push_back(static_cast<float>(q.sign[j] * q.sign[i]));
      }
    }
  }
  return turn;
}

absl::StatusOr<std::optional<CoefficientTurns>> DshTurns(const BtfelTable& table) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DshDecoder> decoder, DshDecoder::Create(table));
  if (!TurnsAsHarmonicsDo(decoder->basis_light()) || !TurnsAsHarmonicsDo(decoder->basis_view())) {
    return std::nullopt;
  }
  CoefficientTurns turns;
  for (int k = 0; k < 4; ++k) {
    turns[k] = MakeDshTurn(decoder->kl(), decoder->kv(), k);
  }
  return turns;
}

}  // namespace tessera
