// The codec "view-pca": for each view the mean and c eigen-textures over the lights [PCAWang 3, 4.4].
#pragma once

#include "btf/codec/codec.h"

namespace tessera {

class ViewPcaCodec final : public Codec {
 public:
  [[nodiscard]] std::string_view id() const override { return "view-pca"; }
  [[nodiscard]] int version() const override { return 1; }
  [[nodiscard]] absl::StatusOr<Material> Encode(BtfSource& source, const EncodeParams& params,
                                                const RunContext& context) const override;
  // Of decoded reflectance: the sampled directions need not be closed under quarter turns.
  [[nodiscard]] absl::StatusOr<Embedding> Embed(const Material& material, int dims,
                                                const RunContext& context) const override;
  [[nodiscard]] absl::StatusOr<CodecGlsl> Glsl(const BtfelTable& table,
                                               std::span<const BtfelTable* const> more) const override;
  [[nodiscard]] absl::StatusOr<HarmonicsGlsl> GlslOfHarmonics(const BtfelTable& table,
                                                              std::span<const BtfelTable* const> more,
                                                              int n) const override;
};

}  // namespace tessera
