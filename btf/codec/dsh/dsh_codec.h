// The codecs "dsh-cls", "dsh-ls" and "dsh": double spherical harmonics, 8-bit coefficients. They differ in
// how they are fitted (dsh_encoder.h) and in their basis tables; decoding, embedding and shader are the same.
#pragma once

#include <string_view>

#include "btf/codec/codec.h"

namespace tessera {

class DshCodec final : public Codec {
 public:
  // As EncodeDsh and its relatives.
  using Encoder = absl::StatusOr<Material> (*)(BtfSource& source, const EncodeParams& params,
                                               const RunContext& context);

  DshCodec(std::string_view id, Encoder encoder) : id_(id), encoder_(encoder) {}

  [[nodiscard]] std::string_view id() const override { return id_; }
  [[nodiscard]] int version() const override { return 1; }
  [[nodiscard]] absl::StatusOr<Material> Encode(BtfSource& source, const EncodeParams& params,
                                                const RunContext& context) const override;
  [[nodiscard]] absl::StatusOr<Embedding> Embed(const Material& material, int dims,
                                                const RunContext& context) const override;
  [[nodiscard]] absl::StatusOr<CodecGlsl> Glsl(const BtfelTable& table,
                                               std::span<const BtfelTable* const> more) const override;
  [[nodiscard]] absl::StatusOr<HarmonicsGlsl> GlslOfHarmonics(const BtfelTable& table,
                                                              std::span<const BtfelTable* const> more,
                                                              int n) const override;
  [[nodiscard]] absl::StatusOr<std::optional<CoefficientTurns>> Turns(const BtfelTable& table) const override;

 private:
  std::string_view id_;
  Encoder encoder_;
};

}  // namespace tessera
