#include "server/jobs/generate_job.h"

#include <memory>
#include <optional>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/choice/encode_model.h"
#include "btf/data/direction_sets.h"
#include "btf/data/half_btf.h"
#include "btf/image/image_io.h"
#include "btf/meso/generate.h"
#include "proto/wire/convert.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/jobs/encode.h"

namespace tessera {
namespace {

constexpr uint64_t kMaxImageBytes = uint64_t{256} << 20;
constexpr uint32_t kMaxSize = 1 << 14;  // keeps the cast exact; the generator knows the real limit

absl::StatusOr<GenerateParams> ParamsFromRequest(const v1::GenerateMaterialRequest& request) {
  GenerateParams params;
  params.kind = request.kind();
  if (request.size() > kMaxSize) {
    return absl::InvalidArgumentError(absl::StrCat("size ", request.size(), ", at most ", kMaxSize));
  }
  params.size = static_cast<int>(request.size());
  params.seed = request.seed();
  params.height_scale_texels = request.height_scale();
  TESSERA_ASSIGN_OR_RETURN(params.lights, DirectionSet(request.lights()));
  TESSERA_ASSIGN_OR_RETURN(params.views, DirectionSet(request.views()));
  return params;
}

// `request` with its defaults filled in.
absl::StatusOr<Material> GenerateAndEncode(const v1::GenerateMaterialRequest& request,
                                           const JobContext& context) {
  TESSERA_ASSIGN_OR_RETURN(GenerateParams params, ParamsFromRequest(request));
  const auto read_image = [&](const std::string& sha256, std::string_view name,
                              const std::optional<Transfer>& transfer,
                              std::optional<Image>& image) -> absl::Status {
    if (sha256.empty()) {
      return absl::OkStatus();
    }
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, context.blobs->ReadAll(sha256, kMaxImageBytes));
    TESSERA_ASSIGN_OR_RETURN(image, DecodeImage(std::as_bytes(std::span(bytes)), name, transfer));
    return absl::OkStatus();
  };
  // Height and roughness are measures, not colours: their codes are taken as they are.
  TESSERA_RETURN_IF_ERROR(read_image(request.height_sha256(), "height", Transfer::Linear(), params.height));
  TESSERA_RETURN_IF_ERROR(read_image(request.colour_sha256(), "colour", std::nullopt, params.colour));
  TESSERA_RETURN_IF_ERROR(
      read_image(request.roughness_sha256(), "roughness", Transfer::Linear(), params.roughness));
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<BtfSource> source, GenerateBtf(params, context.run));
  if (request.encode().codec() == kAutoCodec) {
    // A choice reads the source dozens of times, and every reading would trace it again.
    TESSERA_ASSIGN_OR_RETURN(source, HalfBtf::SpillingCopyOf(*source, EncodeParams{}.memory_budget_bytes / 4,
                                                             context.scratch_folder, context.run));
  }
  return EncodeSource(*source, request.encode(), context.scratch_folder, context.run);
}

}  // namespace

void FillDefaults(v1::GenerateMaterialRequest& request) {
  if (request.size() == 0) {
    request.set_size(128);
  }
  if (request.lights().empty()) {
    request.set_lights("ubo81");
  }
  if (request.views().empty()) {
    request.set_views("ubo81");
  }
  FillDefaults(*request.mutable_encode());
}

std::vector<std::string> GenerateInputs(const v1::GenerateMaterialRequest& request) {
  std::vector<std::string> inputs;
  for (const std::string& sha256 :
       {request.height_sha256(), request.colour_sha256(), request.roughness_sha256()}) {
    if (!sha256.empty()) {
      inputs.push_back(sha256);
    }
  }
  return inputs;
}

absl::Status CheckGenerateRequest(const v1::GenerateMaterialRequest& request) {
  v1::GenerateMaterialRequest filled = request;
  FillDefaults(filled);
  TESSERA_ASSIGN_OR_RETURN(const GenerateParams params, ParamsFromRequest(filled));
  TESSERA_RETURN_IF_ERROR(CheckGenerateParams(params));
  const bool from_images = request.kind() == "heightmap";
  if (from_images && (request.height_sha256().empty() || request.colour_sha256().empty())) {
    return WithReason(absl::InvalidArgumentError("kind heightmap needs height_sha256 and colour_sha256"),
                      "ARGUMENT_INVALID", "height_sha256");
  }
  if (!from_images && !GenerateInputs(request).empty()) {
    return WithReason(absl::InvalidArgumentError(absl::StrCat("kind ", request.kind(), " takes no images")),
                      "ARGUMENT_INVALID", "height_sha256");
  }
  for (const std::string& sha256 : GenerateInputs(request)) {
    TESSERA_RETURN_IF_ERROR(CheckDigest(sha256, "height_sha256, colour_sha256 or roughness_sha256"));
  }
  return CheckEncodeOptions(filled.encode());
}

absl::StatusOr<JobOutput> RunGenerateJob(const JobInput& input, const JobContext& context) {
  v1::GenerateMaterialRequest request;
  if (!request.ParseFromString(input.params)) {
    return absl::InternalError("a generate job takes a GenerateMaterialRequest");
  }
  FillDefaults(request);
  const absl::StatusOr<Material> material = GenerateAndEncode(request, context);
  if (!material.ok()) {
    return WithoutFolder(material.status(), context.scratch_folder);
  }
  return OutputOfMaterial(*material);
}

}  // namespace tessera
