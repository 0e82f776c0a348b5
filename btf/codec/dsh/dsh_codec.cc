#include "btf/codec/dsh/dsh_codec.h"

#include "btf/codec/dsh/dsh_embedding.h"
#include "btf/codec/dsh/dsh_glsl.h"
#include "btf/codec/dsh/dsh_turns.h"

namespace tessera {

absl::StatusOr<Material> DshCodec::Encode(BtfSource& source, const EncodeParams& params,
                                          const RunContext& context) const {
  return encoder_(source, params, context);
}

absl::StatusOr<Embedding> DshCodec::Embed(const Material& material, int dims,
                                          const RunContext& context) const {
  return EmbedDsh(material, dims, context);
}

absl::StatusOr<CodecGlsl> DshCodec::Glsl(const BtfelTable& table,
                                         std::span<const BtfelTable* const> more) const {
  return DshGlsl(table, more);
}

absl::StatusOr<HarmonicsGlsl> DshCodec::GlslOfHarmonics(const BtfelTable& table,
                                                        std::span<const BtfelTable* const> /*more*/,
                                                        int n) const {
  return DshHarmonicsGlsl(table, n);
}

absl::StatusOr<std::optional<CoefficientTurns>> DshCodec::Turns(const BtfelTable& table) const {
  return DshTurns(table);
}

}  // namespace tessera
