#include "server/jobs/synthesize_job.h"

#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/material.h"
#include "btf/tiles/pattern.h"
#include "btf/tiles/recipe.h"
#include "btf/tiles/synthesize.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/tile_set.h"
#include "proto/wire/convert.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"

namespace tessera {
namespace {

constexpr uint32_t kMaxTileSize = 1024;
constexpr uint32_t kMinStripHeight = kSmallestStrip;

}  // namespace

void FillDefaults(v1::SynthesizeTileSetRequest& request) {
  if (request.method().empty()) {
    request.set_method(std::string(SynthesisMethodName(SynthesisParams().method)));
  }
  if (request.effort() == 0) {
    request.set_effort(SynthesisParams().effort);
  }
  if (const absl::StatusOr<Recipe> recipe = ParseRecipe(request.recipe_json()); recipe.ok()) {
    request.set_recipe_json(recipe->json.dump());
  }
}

absl::Status CheckSynthesizeRequest(const v1::SynthesizeTileSetRequest& request,
                                    const Arrangement& arrangement) {
  v1::SynthesizeTileSetRequest filled = request;
  FillDefaults(filled);
  const auto refuse = [](const std::string& message, std::string_view field) {
    return WithReason(absl::InvalidArgumentError(message), "ARGUMENT_INVALID", field);
  };
  const absl::StatusOr<SynthesisMethod> method = ParseSynthesisMethod(filled.method());
  if (!method.ok()) {
    return refuse(std::string(method.status().message()), "method");
  }
  // What is 0 is chosen by the job, from the material.
  const uint32_t strip_height = filled.strip_height() == 0 ? kMinStripHeight : filled.strip_height();
  const uint64_t tile_size = filled.tile_size() == 0 ? 2 * uint64_t{strip_height} : filled.tile_size();
  if (strip_height < kMinStripHeight || strip_height % 2 != 0) {
    return refuse(absl::StrCat("strip_height ", strip_height, ", expected an even number of at least ",
                               kMinStripHeight),
                  "strip_height");
  }
  if (tile_size > kMaxTileSize || tile_size < 2 * uint64_t{strip_height}) {
    return refuse(absl::StrCat("tile_size ", tile_size, ", expected twice the strip height (",
                               2 * uint64_t{strip_height}, ") to ", kMaxTileSize),
                  "tile_size");
  }
  if (filled.effort() > kMostEffort) {
    return refuse(absl::StrCat("effort ", filled.effort(), ", expected 1 to ", kMostEffort), "effort");
  }
  if (*method != SynthesisMethod::kFrame && tile_size % 2 != 0) {
    return refuse(absl::StrCat("tile_size ", tile_size, ", expected an even number for method \"",
                               filled.method(), "\""),
                  "tile_size");
  }
  if (filled.recipe_json().empty()) {
    return absl::OkStatus();
  }
  if (*method != SynthesisMethod::kFrame) {
    return refuse(absl::StrCat("method \"", filled.method(), "\" takes no recipe"), "recipe_json");
  }
  const absl::StatusOr<Recipe> recipe = ParseRecipe(filled.recipe_json());
  // A size that the job will choose is taken at its largest here; the job checks again.
  const int recipe_tile =
      filled.tile_size() == 0 ? static_cast<int>(kMaxTileSize) : static_cast<int>(filled.tile_size());
  const int recipe_strip =
      filled.strip_height() == 0 ? recipe_tile / 2 : static_cast<int>(filled.strip_height());
  const absl::Status checked =
      recipe.ok() ? CheckRecipe(*recipe, arrangement, recipe_tile, recipe_strip) : recipe.status();
  return checked.ok() ? checked : refuse(std::string(checked.message()), "recipe_json");
}

absl::StatusOr<JobOutput> RunSynthesizeJob(const JobInput& input, const JobContext& context) {
  v1::SynthesizeTileSetRequest request;
  if (!request.ParseFromString(input.params) || input.inputs.size() != 1) {
    return absl::InternalError("a synthesize job takes a SynthesizeTileSetRequest and one blob");
  }
  FillDefaults(request);
  TESSERA_ASSIGN_OR_RETURN(const std::string arrangement_id, ParseArrangementName(request.name()));
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(arrangement_id));
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, context.blobs->ReadAll(input.inputs[0], kMaxContainerBytes));
  TESSERA_ASSIGN_OR_RETURN(const Material material, ParseMaterial(std::as_bytes(std::span(bytes))));
  std::string().swap(bytes);
  SynthesisParams params;
  params.tile_size = static_cast<int>(request.tile_size());
  params.strip_height = static_cast<int>(request.strip_height());
  params.seed = request.seed();
  params.force = request.force();
  params.effort = static_cast<int>(request.effort());
  TESSERA_ASSIGN_OR_RETURN(params.method, ParseSynthesisMethod(request.method()));
  if (!request.recipe_json().empty()) {
    TESSERA_ASSIGN_OR_RETURN(params.recipe, ParseRecipe(request.recipe_json()));
  }
  TESSERA_ASSIGN_OR_RETURN(TileSet tile_set, SynthesizeTileSet(material, *arrangement, params, context.run));
  tile_set.metadata[kMaterialDigestKey] = input.inputs[0];
  TESSERA_ASSIGN_OR_RETURN(std::string container, SerializeTileSet(tile_set));
  return JobOutput{std::move(container), MessageFromTileSet(tile_set)};
}

}  // namespace tessera
