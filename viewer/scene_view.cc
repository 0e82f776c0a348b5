#include "viewer/scene_view.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "btf/base/status_macros.h"
#include "btf/image/transfer.h"
#include "btf/render/composite.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dress.h"
#include "viewer/viewer_state.h"

namespace tessera::viewer {
namespace {

using Clock = std::chrono::steady_clock;

double MsSince(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

// A unit of linear light is cut into this many steps: 16 of them at the steepest 8-bit step of the sRGB
// curve.
constexpr int kCurveSteps = 1 << 16;

const std::vector<uint8_t>& SrgbCodes() {
  static const std::vector<uint8_t> codes = [] {
    std::vector<uint8_t> table(kCurveSteps + 1);
    for (int i = 0; i <= kCurveSteps; ++i) {
      table[i] =
          static_cast<uint8_t>(std::lround(255.0 * SrgbFromLinear(static_cast<double>(i) / kCurveSteps)));
    }
    return table;
  }();
  return codes;
}

absl::StatusOr<Pixels> PixelsOf(const Image& picture) {
  TESSERA_ASSIGN_OR_RETURN(const Image opaque, CompositeOver(picture, Background{}));
  const std::vector<uint8_t>& codes = SrgbCodes();
  Pixels pixels{opaque.width, opaque.height, {}};
  const size_t count = static_cast<size_t>(opaque.width) * opaque.height;
  pixels.rgba.resize(count * 4, 255);
  for (size_t i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) {
      const float value = opaque.pixels[i * opaque.channels + c];
      // Not-a-number compares false: it becomes 0.
      const float clamped = value > 0.0F ? std::min(value, 1.0F) : 0.0F;
      pixels.rgba[i * 4 + c] = codes[static_cast<size_t>(clamped * kCurveSteps + 0.5F)];
    }
  }
  return pixels;
}

// A square of 2 x 2 quads that face +z.
QuadMesh Patch() {
  QuadMesh mesh;
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) {
      mesh.positions.emplace_back(static_cast<float>(x - 1), static_cast<float>(y - 1), 0.0F);
      mesh.normals.emplace_back(0.0F, 0.0F, 1.0F);
    }
  }
  for (uint32_t y = 0; y < 2; ++y) {
    for (uint32_t x = 0; x < 2; ++x) {
      const uint32_t first = 3 * y + x;
      mesh.quads.push_back({first, first + 1, first + 4, first + 3});
    }
  }
  return mesh;
}

// Fills the picture with the patch.
Camera PatchCamera() {
  Camera camera;
  camera.eye = {0.0, 0.0, 1.0 / std::tan(0.5 * camera.fov_y_rad)};
  return camera;
}

}  // namespace

SceneView::SceneView(OffscreenContext& context, std::function<void()> wake)
    : context_(context),
      wake_(std::move(wake)),
      thread_([this](std::stop_token stop) { Run(std::move(stop)); }) {}

SceneView::~SceneView() {
  thread_.request_stop();
  thread_.join();
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

void SceneView::AskThumbnail(std::string name, std::shared_ptr<const TileSet> tile_set) {
  {
    const std::lock_guard lock(mutex_);
    thumbnail_requests_.emplace_back(std::move(name), std::move(tile_set));
  }
  changed_.notify_one();
}

std::optional<ScenePicture> SceneView::TakePicture() {
  const std::lock_guard lock(mutex_);
  return std::exchange(picture_, std::nullopt);
}

std::vector<Thumbnail> SceneView::TakeThumbnails() {
  const std::lock_guard lock(mutex_);
  return std::exchange(thumbnails_, {});
}

bool SceneView::IsIdle() const {
  const std::lock_guard lock(mutex_);
  return !busy_ && !request_ && thumbnail_requests_.empty() && !picture_ && thumbnails_.empty();
}

void SceneView::Run(std::stop_token stop) {
  const RunContext context{.stop = stop};
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return request_ || !thumbnail_requests_.empty(); }) &&
         !stop.stop_requested()) {
    busy_ = true;
    if (request_) {
      const SceneRequest request = *std::exchange(request_, std::nullopt);
      const uint64_t number = num_asked_;
      lock.unlock();
      ScenePicture picture = Draw(request, context);
      picture.number = number;
      lock.lock();
      picture_ = std::move(picture);
    } else {
      auto [name, tile_set] = std::move(thumbnail_requests_.front());
      thumbnail_requests_.pop_front();
      lock.unlock();
      Thumbnail thumbnail = DrawThumbnail(name, std::move(tile_set), context);
      lock.lock();
      thumbnails_.push_back(std::move(thumbnail));
    }
    busy_ = false;
    if (wake_) {
      wake_();
    }
  }
  lock.unlock();
  prepared_.Clear();
}

absl::StatusOr<GlPreview*> SceneView::Prepare(const SceneRequest& request, double& prepare_ms) {
  const Key key{request.dressing.get(), request.tile_set.get()};
  if (const Prepared* const prepared = prepared_.Use(key)) {
    return prepared->preview.get();
  }
  const auto begin = Clock::now();
  TESSERA_ASSIGN_OR_RETURN(auto preview, GlPreview::Create(context_, *request.dressing, *request.tile_set));
  Prepared& kept = prepared_.Put(key, {request.dressing, request.tile_set, std::move(preview)},
                                 SizeInMemory(*request.tile_set));
  prepare_ms = MsSince(begin);
  return kept.preview.get();
}

ScenePicture SceneView::Draw(const SceneRequest& request, const RunContext& context) {
  ScenePicture picture{.tile_set = request.tile_set};
  const absl::StatusOr<GlPreview*> preview = Prepare(request, picture.prepare_ms);
  if (!preview.ok()) {
    picture.status = preview.status();
    return picture;
  }
  PreviewScene scene;
  scene.dressing = request.dressing.get();
  scene.tile_set = request.tile_set.get();
  scene.camera = request.camera;
  scene.lights = request.lights;
  scene.width = request.width;
  scene.height = request.height;
  const auto begin = Clock::now();
  const absl::StatusOr<Image> image = (*preview)->Render(scene, context);
  absl::StatusOr<Pixels> pixels = image.ok() ? PixelsOf(*image) : image.status();
  picture.draw_ms = MsSince(begin);
  picture.status = pixels.status();
  if (pixels.ok()) {
    picture.pixels = *std::move(pixels);
    picture.texels_per_pixel = TexelsPerPixel(scene);
  }
  return picture;
}

Thumbnail SceneView::DrawThumbnail(const std::string& name, std::shared_ptr<const TileSet> tile_set,
                                   const RunContext& context) {
  const auto draw = [&]() -> absl::StatusOr<Pixels> {
    TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(tile_set->arrangement_id));
    TESSERA_ASSIGN_OR_RETURN(
        const DressResult dressed,
        DressMesh(Patch(), *arrangement, {.allow_breaks = true, .target_quads = 4}, context));
    PreviewScene scene;
    scene.dressing = &dressed.dressing;
    scene.tile_set = tile_set.get();
    scene.camera = PatchCamera();
    scene.width = scene.height = kThumbnailSide;
    TESSERA_ASSIGN_OR_RETURN(const Image image, RenderGl(context_, scene, context));
    return PixelsOf(image);
  };
  absl::StatusOr<Pixels> pixels = draw();
  return {name, pixels.status(), pixels.ok() ? *std::move(pixels) : Pixels{}};
}

}  // namespace tessera::viewer
