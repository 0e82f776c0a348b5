#include "server/jobs/encode.h"

#include <absl/strings/str_replace.h>

#include "btf/base/status_macros.h"
#include "btf/choice/encode_model.h"
#include "proto/wire/convert.h"

namespace tessera {

absl::Status CheckEncodeOptions(const v1::EncodeOptions& options) {
  TESSERA_ASSIGN_OR_RETURN(const ModelRequest request, ModelRequestFromMessage(options));
  return CheckModelRequest(request);
}

absl::StatusOr<Material> EncodeSource(BtfSource& source, const v1::EncodeOptions& options,
                                      const std::filesystem::path& scratch_folder,
                                      const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(ModelRequest request, ModelRequestFromMessage(options));
  request.params.spill_folder = scratch_folder;
  return EncodeModel(source, request, context);
}

absl::Status WithoutFolder(const absl::Status& status, const std::filesystem::path& folder) {
  if (status.ok()) {
    return status;
  }
  absl::Status result(status.code(), absl::StrReplaceAll(status.message(), {{folder.string() + "/", ""},
                                                                            {folder.string(), "scratch"}}));
  status.ForEachPayload(
      [&result](absl::string_view url, const absl::Cord& payload) { result.SetPayload(url, payload); });
  return result;
}

absl::StatusOr<JobOutput> OutputOfMaterial(const Material& material) {
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, SerializeMaterial(material));
  return JobOutput{std::move(bytes), MessageFromMaterial(material)};
}

}  // namespace tessera
