// The codec "dfmf": one low-rank factorisation of the whole BTF, 8-bit coefficients.
#pragma once

#include "btf/codec/codec.h"
#include "btf/codec/dfmf/dfmf_decoder.h"

namespace tessera {

class DfmfCodec final : public Codec {
 public:
  [[nodiscard]] std::string_view id() const override { return "dfmf"; }
  [[nodiscard]] int version() const override { return kDfmfVersion; }
  [[nodiscard]] absl::StatusOr<Material> Encode(BtfSource& source, const EncodeParams& params,
                                                const RunContext& context) const override;
  [[nodiscard]] absl::StatusOr<Embedding> Embed(const Material& material, int dims,
                                                const RunContext& context) const override;
  [[nodiscard]] absl::StatusOr<CodecGlsl> Glsl(const BtfelTable& table,
                                               std::span<const BtfelTable* const> more) const override;
  [[nodiscard]] absl::StatusOr<HarmonicsGlsl> GlslOfHarmonics(const BtfelTable& table,
                                                              std::span<const BtfelTable* const> more,
                                                              int n) const override;
};

}  // namespace tessera
