#include "btf/codec/dsh/dsh_codec.h"

#include "btf/codec/dsh/dsh_embedding.h"
#include "btf/codec/dsh/dsh_encoder.h"
#include "btf/codec/dsh/dsh_glsl.h"

namespace tessera {

absl::StatusOr<Material> DshClsCodec::Encode(BtfSource& source, const EncodeParams& params,
                                             const RunContext& context) const {
  return EncodeDshCls(source, params, context);
}

absl::StatusOr<Embedding> DshClsCodec::Embed(const Material& material, int dims,
                                             const RunContext& context) const {
  return EmbedDsh(material, dims, context);
}

absl::StatusOr<CodecGlsl> DshClsCodec::Glsl(const BtfelTable& table) const {
  return DshGlsl(table);
}

}  // namespace tessera
