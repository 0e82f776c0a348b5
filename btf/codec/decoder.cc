#include "btf/codec/decoder.h"

#include <cassert>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/dsh/dsh_decoder.h"

namespace tessera {

void Decoder::Dequantize(std::span<const uint8_t> codes, std::span<double> values) const {
  assert(codes.size() == offset_.size() && values.size() == offset_.size());
  for (size_t i = 0; i < offset_.size(); ++i) {
    values[i] = static_cast<double>(offset_[i]) + static_cast<double>(step_[i]) * codes[i];
  }
}

Eigen::Array3d Decoder::Decode(std::span<const uint8_t> codes, const Eigen::Vector3d& light,
                               const Eigen::Vector3d& view, int turns) const {
  std::vector<double> values(offset_.size());
  Dequantize(codes, values);
  return Evaluate(values, UnturnedFromTurned(light, turns), UnturnedFromTurned(view, turns)).max(0.0);
}

absl::StatusOr<std::unique_ptr<Decoder>> MakeDecoder(const BtfelTable& table) {
  constexpr int kDshVersion = 1;
  if (table.codec_id != "dsh-cls") {
    return absl::UnimplementedError(
        absl::StrCat("codec '", table.codec_id, "' is not known here; known: dsh-cls"));
  }
  if (table.codec_version != kDshVersion) {
    return absl::UnimplementedError(
        absl::StrCat("codec 'dsh-cls' version ", table.codec_version, ", this library reads ", kDshVersion));
  }
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<DshDecoder> decoder, DshDecoder::Create(table));
  return std::unique_ptr<Decoder>(std::move(decoder));
}

}  // namespace tessera
