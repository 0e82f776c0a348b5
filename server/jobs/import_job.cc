#include "server/jobs/import_job.h"

#include <array>
#include <fstream>
#include <memory>

#include "btf/base/status_macros.h"
#include "btf/data/import.h"
#include "proto/wire/convert.h"
#include "server/jobs/encode.h"

namespace tessera {
namespace {

absl::StatusOr<ImportOptions> OptionsFromRequest(const v1::ImportMaterialRequest& request) {
  ImportOptions options;
  TESSERA_ASSIGN_OR_RETURN(options.layout,
                           ParseImportLayout(request.layout().empty() ? "auto" : request.layout()));
  if (!request.transfer().empty()) {
    TESSERA_ASSIGN_OR_RETURN(options.transfer, ParseTransfer(request.transfer()));
  }
  options.provenance = ProvenanceFromMessage(request.provenance());
  return options;
}

// The importer goes by the file's extension.
const char* ExtensionOf(const std::filesystem::path& file) {
  constexpr std::array<char, 4> kExrMagic = {0x76, 0x2f, 0x31, 0x01};
  std::array<char, 4> magic{};
  std::ifstream(file, std::ios::binary).read(magic.data(), magic.size());
  return magic == kExrMagic ? ".exr" : ".zip";
}

absl::StatusOr<Material> ImportAndEncode(const v1::ImportMaterialRequest& request,
                                         const std::string& archive_sha256, const JobContext& context) {
  TESSERA_ASSIGN_OR_RETURN(ImportOptions options, OptionsFromRequest(request));
  options.spill_folder = context.scratch_folder;
  const std::filesystem::path uploaded = context.scratch_folder / "uploaded";
  TESSERA_RETURN_IF_ERROR(context.blobs->CopyTo(archive_sha256, uploaded));
  const std::filesystem::path archive =
      context.scratch_folder / (std::string("archive") + ExtensionOf(uploaded));
  std::error_code error;
  std::filesystem::rename(uploaded, archive, error);
  if (error) {
    return absl::InternalError("cannot prepare the archive: " + error.message());
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> source, ImportBtf(archive, options, context.run));
  return EncodeSource(*source, request.encode(), context.scratch_folder, context.run);
}

}  // namespace

absl::Status CheckImportRequest(const v1::ImportMaterialRequest& request) {
  TESSERA_RETURN_IF_ERROR(OptionsFromRequest(request).status());
  return CheckEncodeOptions(request.encode());
}

absl::StatusOr<JobOutput> RunImportJob(const JobInput& input, const JobContext& context) {
  v1::ImportMaterialRequest request;
  if (!request.ParseFromString(input.params) || input.inputs.size() != 1) {
    return absl::InternalError("an import job takes an ImportMaterialRequest and one blob");
  }
  const absl::StatusOr<Material> material = ImportAndEncode(request, input.inputs[0], context);
  if (!material.ok()) {
    return WithoutFolder(material.status(), context.scratch_folder);
  }
  return OutputOfMaterial(*material);
}

}  // namespace tessera
