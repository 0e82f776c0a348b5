#include "client/lib/flat_decode.h"

#include <memory>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"

namespace tessera {

absl::StatusOr<Image> DecodeFlat(const Material& material, const Direction& light, const Direction& view,
                                 const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
  const auto num_texels = static_cast<size_t>(material.width) * material.height;
  if (material.btfels.size() != num_texels) {
    return absl::InvalidArgumentError(absl::StrCat("material of ", material.width, "x", material.height,
                                                   " has ", material.btfels.size(), " BTFels, expected ",
                                                   num_texels));
  }
  const Eigen::Vector3d wi = VectorFromDirection(light);
  const Eigen::Vector3d wo = VectorFromDirection(view);
  Image picture(material.width, material.height, 3);
  const size_t row_codes = static_cast<size_t>(material.width) * material.btfels.num_coefficients;
  const size_t row_values = static_cast<size_t>(material.width) * 3;
  for (int y = 0; y < material.height; ++y) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    decoder->DecodeTexels(std::span(material.btfels.codes).subspan(y * row_codes, row_codes), wi, wo,
                          /*turns=*/0, std::span(picture.pixels).subspan(y * row_values, row_values));
    context.Report("decoding", static_cast<uint64_t>(y) + 1, static_cast<uint64_t>(material.height), "rows");
  }
  return picture;
}

}  // namespace tessera
