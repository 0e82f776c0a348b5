#include "btf/codec/view_pca/view_pca_codec.h"

#include "btf/codec/embedding.h"
#include "btf/codec/view_pca/view_pca_encoder.h"
#include "btf/codec/view_pca/view_pca_glsl.h"

namespace tessera {

absl::StatusOr<Material> ViewPcaCodec::Encode(BtfSource& source, const EncodeParams& params,
                                              const RunContext& context) const {
  return EncodeViewPca(source, params, context);
}

absl::StatusOr<Embedding> ViewPcaCodec::Embed(const Material& material, int dims,
                                              const RunContext& context) const {
  return EmbedDecoded(material, dims, context);
}

absl::StatusOr<CodecGlsl> ViewPcaCodec::Glsl(const BtfelTable& table,
                                             std::span<const BtfelTable* const> more) const {
  return ViewPcaGlsl(table, more);
}

absl::StatusOr<HarmonicsGlsl> ViewPcaCodec::GlslOfHarmonics(const BtfelTable& table,
                                                            std::span<const BtfelTable* const> /*more*/,
                                                            int n) const {
  return ViewPcaHarmonicsGlsl(table, n);
}

}  // namespace tessera
