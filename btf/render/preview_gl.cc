#include <memory>
#include <utility>
#include <vector>

#include <absl/memory/memory.h>
#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/render/offscreen_context.h"
#include "btf/render/preview.h"
#include "btf/render/preview_drawing.h"
#include "btf/render/preview_resources.h"
#include "btf/render/preview_scene.h"
#include "btf/render/surface.h"

namespace tessera {

GlPreview::GlPreview(OffscreenContext& context, std::unique_ptr<Resources> resources)
    : context_(context), resources_(std::move(resources)) {}

GlPreview::~GlPreview() {
  const ScopedCurrent current(context_);
  resources_.reset();
}

absl::StatusOr<std::unique_ptr<GlPreview>> GlPreview::Create(OffscreenContext& context,
                                                             const Dressing& dressing,
                                                             const TileSet& tile_set, const TileMips* mips) {
  if (dressing.mesh.quads.empty()) {
    return absl::InvalidArgumentError("the dressing has no quads");
  }
  TESSERA_ASSIGN_OR_RETURN(const DressedSurface surface, DressedSurface::Create(dressing, tile_set, mips));
  const Codec* codec = FindCodec(tile_set.btfels.codec_id);
  if (codec == nullptr) {
    return absl::UnimplementedError(absl::StrCat("codec ", tile_set.btfels.codec_id, " is not known here"));
  }
  std::vector<const BtfelTable*> levels;
  for (int level = 1; level <= surface.num_mip_levels(); ++level) {
    levels.push_back(&surface.btfels(level));
  }
  TESSERA_ASSIGN_OR_RETURN(const CodecGlsl glsl, codec->Glsl(tile_set.btfels, levels));
  const ScopedCurrent current(context);
  TESSERA_RETURN_IF_ERROR(current.status());
  TESSERA_ASSIGN_OR_RETURN(GlState* const state, context.gl_state());
  auto resources = std::make_unique<Resources>(*state, dressing, tile_set, mips);
  TESSERA_RETURN_IF_ERROR(resources->Fill(surface, glsl));
  return absl::WrapUnique(new GlPreview(context, std::move(resources)));
}

absl::StatusOr<Image> GlPreview::Render(const PreviewScene& scene, const RunContext& run_context) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  if (scene.dressing != &resources_->dressing || scene.tile_set != &resources_->tile_set ||
      scene.mips != resources_->mips) {
    return absl::InvalidArgumentError("the scene shows another dressing, tile set or mips than the preview");
  }
  const ScopedCurrent current(context_);
  TESSERA_RETURN_IF_ERROR(current.status());
  return PreviewDrawing(*resources_, scene).Draw(run_context);
}

absl::StatusOr<Image> RenderGl(OffscreenContext& context, const PreviewScene& scene,
                               const RunContext& run_context) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<GlPreview> preview,
                           GlPreview::Create(context, *scene.dressing, *scene.tile_set, scene.mips));
  return preview->Render(scene, run_context);
}

}  // namespace tessera
