// A picture of a dressed mesh: the scene, and its two renderers.
//
//   PreviewScene scene{.dressing = &dressing, .tile_set = &tile_set};
//   scene.camera = FramingCamera(dressing.mesh);
//   TESSERA_ASSIGN_OR_RETURN(Image image, RenderGl(*context, scene, run_context));
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/run_context.h"
#include "btf/image/image.h"
#include "btf/math/conventions.h"
#include "btf/mips/tile_mips.h"
#include "btf/wang/dressing.h"
#include "btf/wang/tile_set.h"

namespace tessera {

class FrequencyLight;
struct EnvironmentLight;
class OffscreenContext;

// The eye looks at the target; `up` points upwards in the picture, perpendicular or not.
struct Camera {
  Eigen::Vector3d eye{0, 0, 3};
  Eigen::Vector3d target{0, 0, 0};
  Eigen::Vector3d up{0, 1, 0};
  double fov_y_rad = RadFromDeg(35.0);  // 0.1..170 degrees, from the lower to the upper edge
};

struct Light {
  enum class Kind { kDirectional, kPoint };
  Kind kind = Kind::kDirectional;
  // Directional: towards the light, any length. Point: position.
  Eigen::Vector3d place{-0.4, 0.5, 0.8};
  // Irradiance on a facing surface; for a point light at distance 1 (falls with the square).
  Eigen::Vector3d irradiance{kPi, kPi, kPi};
};

// Shadows of the surface on itself, by shadow maps: what is seen of them, their bias and its price are told
// in shadow_views.h and preview_scene.h.
struct ShadowParams {
  int map_size = 1024;  // texels on a side, 64..2048
};

// kNearest shows the stored texels as they are: for looking at a synthesis, and as the measure of what
// filtering costs.
enum class Filter { kBilinear, kNearest };

struct PreviewScene {
  const Dressing* dressing = nullptr;
  const TileSet* tile_set = nullptr;
  // Of tile_set, or none: what Filter::kBilinear shows where texels are smaller than pixels.
  const TileMips* mips = nullptr;
  Camera camera;
  std::vector<Light> lights{Light{}};   // at most 4096
  std::optional<ShadowParams> shadows;  // of `lights`; none: light goes through the surface
  // Light from all around beside `lights`, or none (light/frequency_light.h). Nothing shadows it.
  const FrequencyLight* frequency_light = nullptr;
  int width = 640;   // 16..8192
  int height = 480;  // 16..8192
  Filter filter = Filter::kBilinear;
};

// A camera that sees all of the mesh, from the front and a little above.
[[nodiscard]] Camera FramingCamera(const QuadMesh& mesh, int width, int height);

// A camera on a circle about the vertical through the middle of the mesh.
struct Orbit {
  double azimuth_rad = 0.0;                 // of the eye, from the front (+z) towards +x
  double elevation_rad = RadFromDeg(25.0);  // above the horizon, -pi/2..pi/2
  // 1: the least from which the mesh is inside the frame at every azimuth, so that it keeps its size as the
  // camera goes round; 0.01..1000.
  double distance = 1.0;
  double fov_y_rad = RadFromDeg(35.0);
};
// Errors: INVALID_ARGUMENT naming the member, its value and the limits, or an empty mesh. Cost: 72 looks at
// each vertex.
[[nodiscard]] absl::StatusOr<Camera> OrbitCamera(const QuadMesh& mesh, const Orbit& orbit, int width,
                                                 int height);

// The light turned about the vertical through `centre` as an orbit's eye is: with both, the mesh seems to
// turn before a camera and lights that stand still.
[[nodiscard]] Light LightTurnedAbout(const Light& light, const Eigen::Vector3d& centre, double azimuth_rad);

// Pictures of one tile set on one dressing: its BTFels and the codec's tables stay in the context, so that
// each picture costs only its drawing. One thread at a time; not while another uses the context.
class GlPreview {
 public:
  // The context, the dressing, the tile set and its mips, which may be none, must outlive it, unchanged.
  // Cost: packing and copying the BTFels, and what the codec makes of its tables; preview_bench prints it.
  // Errors: INVALID_ARGUMENT (mesh, codec's tables), FAILED_PRECONDITION (arrangements differ), UNIMPLEMENTED
  // (codec unknown), RESOURCE_EXHAUSTED (tables beyond what GL holds), INTERNAL (GL).
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<GlPreview>> Create(OffscreenContext& context,
                                                                         const Dressing& dressing,
                                                                         const TileSet& tile_set,
                                                                         const TileMips* mips = nullptr);
  ~GlPreview();
  GlPreview(const GlPreview&) = delete;
  GlPreview& operator=(const GlPreview&) = delete;

  // As RenderGl. Errors: also INVALID_ARGUMENT when the scene shows another dressing, tile set or mips. The
  // first picture of a codec's size on a context also compiles its shaders.
  [[nodiscard]] absl::StatusOr<Image> Render(const PreviewScene& scene, const RunContext& run_context);

  class Resources;

 private:
  GlPreview(OffscreenContext& context, std::unique_ptr<Resources> resources);

  OffscreenContext& context_;
  std::unique_ptr<Resources> resources_;
};

// Linear RGBA, not premultiplied: alpha is the share of the pixel's four samples that the mesh covers, RGB
// the mean over those; radiance = sum over lights of value * irradiance / pi (CompositeOver in composite.h
// sets it before a background). Depth-tested; filtered as preview_scene.h and surface.h say; the back of a
// face is black. Errors: INVALID_ARGUMENT (sizes, camera, lights, mesh, named with value and limit),
// FAILED_PRECONDITION (arrangements differ), UNIMPLEMENTED (codec without GLSL), RESOURCE_EXHAUSTED (tables
// beyond what GL holds), CANCELLED (looked at about three times a second), INTERNAL (GL). The context must
// not be in use by another thread. For a single picture: GlPreview draws further ones faster.
[[nodiscard]] absl::StatusOr<Image> RenderGl(OffscreenContext& context, const PreviewScene& scene,
                                             const RunContext& run_context);

// Lights of an environment (light/q2_tree.h) as lights of a scene.
[[nodiscard]] std::vector<Light> DirectionalLights(std::span<const EnvironmentLight> lights);

// How many texels of the tile set lie along the side of a pixel, on the mean over the faces that look at the
// eye, hidden or not; 0 where none does. The scene as RenderGl wants it. Above about 2 mip levels show less
// noise than the four samples of a pixel.
[[nodiscard]] double TexelsPerPixel(const PreviewScene& scene);

// How wide, in pixels, the widest of the faces that look at the eye is along its longest axis, hidden or not;
// 0 where none does. What LevelForPixels (wang/scene_needs.h) asks for. The scene as RenderGl wants it, but
// for the tile set.
[[nodiscard]] double PixelsPerQuad(const PreviewScene& scene);

// The same picture in double precision on the CPU: slow, for tests.
[[nodiscard]] absl::StatusOr<Image> RenderReference(const PreviewScene& scene, const RunContext& run_context);

}  // namespace tessera
