#include "client/lib/flat_decode.h"

#include <memory>

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
  for (int y = 0; y < material.height; ++y) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (int x = 0; x < material.width; ++x) {
      const size_t texel = static_cast<size_t>(y) * material.width + x;
      const Eigen::Array3d rgb = decoder->Decode(material.btfels.btfel(texel), wi, wo, /*turns=*/0);
      for (int channel = 0; channel < 3; ++channel) {
        picture.at(x, y)[channel] = static_cast<float>(rgb[channel]);
      }
    }
    context.Report("decoding", static_cast<uint64_t>(y) + 1, static_cast<uint64_t>(material.height), "rows");
  }
  return picture;
}

}  // namespace tessera
