#include "viewer/scene_view.h"

#include <utility>

#include "btf/base/status_macros.h"
#include "btf/render/composite.h"
#include "viewer/viewer_state.h"

namespace tessera::viewer {
namespace {

using Clock = std::chrono::steady_clock;

double MsSince(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

absl::StatusOr<Pixels> Developed(Image picture, const Tone& tone) {
  TESSERA_RETURN_IF_ERROR(ApplyTone(tone, picture));
  TESSERA_ASSIGN_OR_RETURN(const Image opaque, CompositeOver(picture, Background{}));
  return PixelsOf(opaque);
}

}  // namespace

SceneView::SceneView(OffscreenContext& context, std::function<void()> wake)
    : context_(context),
      wake_(std::move(wake)),
      mip_maker_([this] { DrawAgain(); }),
      thread_([this](std::stop_token stop) { Run(std::move(stop)); }) {}

SceneView::~SceneView() {
  thread_.request_stop();
  thread_.join();
}

void SceneView::DrawAgain() {
  {
    const std::lock_guard lock(mutex_);
    if (!request_) {
      request_ = last_request_;
    }
  }
  changed_.notify_one();
}

uint64_t SceneView::Ask(SceneRequest request) {
  uint64_t number = 0;
  {
    const std::lock_guard lock(mutex_);
    request_ = std::move(request);
    number = ++num_asked_;
  }
  changed_.notify_one();
  return number;
}

std::optional<ScenePicture> SceneView::TakePicture() {
  const std::lock_guard lock(mutex_);
  return std::exchange(picture_, std::nullopt);
}

bool SceneView::IsIdle() const {
  const std::lock_guard lock(mutex_);
  return !busy_ && !request_ && !picture_ && !mip_maker_.IsBusy();
}

void SceneView::Run(std::stop_token stop) {
  const RunContext context{.stop = stop};
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return request_.has_value(); }) && !stop.stop_requested()) {
    busy_ = true;
    const SceneRequest request = *std::exchange(request_, std::nullopt);
    const uint64_t number = num_asked_;
    last_request_ = request;
    lock.unlock();
    ScenePicture picture = Draw(request, context);
    picture.number = number;
    lock.lock();
    picture_ = std::move(picture);
    busy_ = false;
    if (wake_) {
      wake_();
    }
  }
  lock.unlock();
  prepared_.Clear();
}

absl::StatusOr<GlPreview*> SceneView::Prepare(const SceneRequest& request,
                                              const std::shared_ptr<const TileMips>& mips,
                                              double& prepare_ms) {
  const Key key{request.dressing.get(), request.tile_set.get(), mips.get()};
  if (const Prepared* const prepared = prepared_.Use(key)) {
    return prepared->preview.get();
  }
  const auto begin = Clock::now();
  TESSERA_ASSIGN_OR_RETURN(auto preview,
                           GlPreview::Create(context_, *request.dressing, *request.tile_set, mips.get()));
  Prepared& kept =
      prepared_.Put(key, {request.dressing, request.tile_set, mips, std::move(preview)},
                    SizeInMemory(*request.tile_set) + (mips == nullptr ? 0 : mips->size_bytes()));
  prepare_ms = MsSince(begin);
  return kept.preview.get();
}

ScenePicture SceneView::Draw(const SceneRequest& request, const RunContext& context) {
  ScenePicture picture{.tile_set = request.tile_set};
  PreviewScene scene;
  scene.dressing = request.dressing.get();
  scene.tile_set = request.tile_set.get();
  scene.camera = request.camera;
  scene.lights = request.lights;
  scene.frequency_light = request.sky.has_value() ? &*request.sky : nullptr;
  scene.width = request.width;
  scene.height = request.height;
  picture.texels_per_pixel = TexelsPerPixel(scene);
  std::shared_ptr<const TileMips> mips;
  if (picture.texels_per_pixel > kTexelsWithoutMips) {
    MipMaker::Answer answer = mip_maker_.Get(request.tile_set);
    mips = std::move(answer.mips);
    picture.why_no_mips = std::move(answer.why_none);
    picture.mips = mips != nullptr               ? MipUse::kDrawn
                   : picture.why_no_mips.empty() ? MipUse::kComing
                                                 : MipUse::kNone;
    scene.mips = mips.get();
  }
  const absl::StatusOr<GlPreview*> preview = Prepare(request, mips, picture.prepare_ms);
  if (!preview.ok()) {
    picture.status = preview.status();
    return picture;
  }
  const auto begin = Clock::now();
  absl::StatusOr<Image> image = (*preview)->Render(scene, context);
  absl::StatusOr<Pixels> pixels = image.ok() ? Developed(*std::move(image), request.tone) : image.status();
  picture.draw_ms = MsSince(begin);
  picture.status = pixels.status();
  if (pixels.ok()) {
    picture.pixels = *std::move(pixels);
  }
  return picture;
}

}  // namespace tessera::viewer
