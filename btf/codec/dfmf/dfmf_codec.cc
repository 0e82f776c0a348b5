#include "btf/codec/dfmf/dfmf_codec.h"

#include "btf/codec/dfmf/dfmf_embedding.h"
#include "btf/codec/dfmf/dfmf_encoder.h"
#include "btf/codec/dfmf/dfmf_glsl.h"

namespace tessera {

absl::StatusOr<Material> DfmfCodec::Encode(BtfSource& source, const EncodeParams& params,
                                           const RunContext& context) const {
  return EncodeDfmf(source, params, context);
}

absl::StatusOr<Embedding> DfmfCodec::Embed(const Material& material, int dims,
                                           const RunContext& context) const {
  return EmbedDfmf(material, dims, context);
}

absl::StatusOr<CodecGlsl> DfmfCodec::Glsl(const BtfelTable& table,
                                          std::span<const BtfelTable* const> more) const {
  return DfmfGlsl(table, more);
}

absl::StatusOr<HarmonicsGlsl> DfmfCodec::GlslOfHarmonics(const BtfelTable& table,
                                                         std::span<const BtfelTable* const> more,
                                                         int n) const {
  return DfmfHarmonicsGlsl(table, more, n);
}

}  // namespace tessera
