#include "server/jobs/encode.h"

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/codec/diagnosis.h"
#include "proto/wire/convert.h"
#include "proto/wire/status.h"

namespace tessera {
namespace {

absl::StatusOr<const Codec*> CodecOf(const v1::EncodeOptions& filled) {
  const Codec* codec = FindCodec(filled.codec());
  if (codec == nullptr) {
    std::string known;
    for (const std::string_view id : CodecIds()) {
      known.append(known.empty() ? "" : ", ").append(id);
    }
    return WithReason(
        absl::InvalidArgumentError(absl::StrCat("unknown codec \"", filled.codec(), "\", known: ", known)),
        "ARGUMENT_INVALID", "encode.codec");
  }
  return codec;
}

}  // namespace

absl::Status CheckEncodeOptions(const v1::EncodeOptions& options) {
  v1::EncodeOptions filled = options;
  FillDefaults(filled);
  TESSERA_RETURN_IF_ERROR(CodecOf(filled).status());
  return EncodeParamsFromMessage(filled).status();
}

absl::StatusOr<Material> EncodeSource(BtfSource& source, const v1::EncodeOptions& options,
                                      const RunContext& context) {
  v1::EncodeOptions filled = options;
  FillDefaults(filled);
  TESSERA_ASSIGN_OR_RETURN(const Codec* codec, CodecOf(filled));
  TESSERA_ASSIGN_OR_RETURN(const EncodeParams params, EncodeParamsFromMessage(filled));
  TESSERA_ASSIGN_OR_RETURN(Material material, codec->Encode(source, params, context));
  TESSERA_RETURN_IF_ERROR(RecordDiagnosis(source, context, material));
  return material;
}

absl::StatusOr<JobOutput> OutputOfMaterial(const Material& material) {
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, SerializeMaterial(material));
  return JobOutput{std::move(bytes), MessageFromMaterial(material)};
}

}  // namespace tessera
