// The picture of preview.h in double precision: triangles tested sample by sample, frames and taps of
// surface.h, the decoder of codec/decoder.h, rays to the lights. Shares no arithmetic with the shaders.
#include "btf/render/reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/render/occlusion.h"
#include "btf/render/preview_scene.h"
#include "btf/render/surface.h"

namespace tessera {
namespace {

// What one sample sees.
struct Hit {
  double depth = std::numeric_limits<double>::infinity();  // along the view axis
  SurfacePoint point;
  bool front = false;
};

// Rays of the camera in a frame whose origin is the surface's centre.
class Rays {
 public:
  Rays(const ViewFrame& view, const Eigen::Vector3d& centre, int width, int height)
      : eye_(view.eye - centre), view_(view), width_(width), height_(height) {}

  // Of a place in the picture, in pixels; its component along the view axis is 1.
  [[nodiscard]] Eigen::Vector3d Direction(double x, double y) const {
    const double tan_x = view_.tan_half_fov_y * width_ / height_;
    return (2.0 * x / width_ - 1.0) * tan_x * view_.right +
           (1.0 - 2.0 * y / height_) * view_.tan_half_fov_y * view_.up - view_.back;
  }

  // Place in the picture and depth of a point in front of the eye.
  [[nodiscard]] Eigen::Vector3d Project(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d d = p - eye_;
    const double depth = -d.dot(view_.back);
    const double tan_x = view_.tan_half_fov_y * width_ / height_;
    return {0.5 * width_ * (1.0 + d.dot(view_.right) / (depth * tan_x)),
            0.5 * height_ * (1.0 - d.dot(view_.up) / (depth * view_.tan_half_fov_y)), depth};
  }

  [[nodiscard]] const Eigen::Vector3d& eye() const { return eye_; }

 private:
  Eigen::Vector3d eye_;
  ViewFrame view_;
  int width_;
  int height_;
};

// Points just outside a triangle, by rounding, still hit it: neighbours would else leave gaps.
constexpr double kEdgeTolerance = 1e-12;

// Tests every sample of the rows [first_row, last_row] within the triangle's bounds.
void DrawTriangle(const SurfaceTriangles& triangles, size_t first_index, const Rays& rays,
                  const ViewFrame& view, int width, int first_row, int last_row, std::vector<Hit>* hits) {
  std::array<const SurfaceVertex*, 3> vertex;
  std::array<Eigen::Vector3d, 3> p;
  Eigen::Vector2d low(1e300, 1e300);
  Eigen::Vector2d high = -low;
  bool bounded = true;
  for (int k = 0; k < 3; ++k) {
    vertex[k] = &triangles.vertices[triangles.indices[first_index + k]];
    p[k] = vertex[k]->position.cast<double>();
    const Eigen::Vector3d place = rays.Project(p[k]);
    bounded = bounded && place.z() > 1e-3 * view.near;
    low = low.cwiseMin(place.head<2>());
    high = high.cwiseMax(place.head<2>());
  }
  int x_begin = 0;
  int x_end = width - 1;
  if (bounded) {
    x_begin = static_cast<int>(std::clamp(std::floor(low.x()) - 1.0, 0.0, width - 1.0));
    x_end = static_cast<int>(std::clamp(std::ceil(high.x()) + 1.0, 0.0, width - 1.0));
    first_row = std::max(first_row, static_cast<int>(std::clamp(std::floor(low.y()) - 1.0, 0.0, 1e9)));
    last_row = std::min(last_row, static_cast<int>(std::clamp(std::ceil(high.y()) + 1.0, -1.0, 1e9)));
  }
  const Eigen::Vector3d edge1 = p[1] - p[0];
  const Eigen::Vector3d edge2 = p[2] - p[0];
  const Eigen::Vector3d from_p0 = rays.eye() - p[0];
  const Eigen::Vector3d normal = edge1.cross(edge2);
  for (int y = first_row; y <= last_row; ++y) {
    for (int x = x_begin; x <= x_end; ++x) {
      for (int i = 0; i < kSamplesPerPixel; ++i) {
        const Eigen::Vector3d ray =
            rays.Direction(x + 0.5 + kSampleOffsets[i][0], y + 0.5 + kSampleOffsets[i][1]);
        // Moeller and Trumbore: eye + depth ray = p0 + a edge1 + b edge2.
        const Eigen::Vector3d ray_x_edge2 = ray.cross(edge2);
        const double determinant = edge1.dot(ray_x_edge2);
        if (determinant == 0.0) {
          continue;
        }
        const double a = from_p0.dot(ray_x_edge2) / determinant;
        const Eigen::Vector3d from_x_edge1 = from_p0.cross(edge1);
        const double b = ray.dot(from_x_edge1) / determinant;
        if (a < -kEdgeTolerance || b < -kEdgeTolerance || a + b > 1.0 + kEdgeTolerance) {
          continue;
        }
        const double depth = edge2.dot(from_x_edge1) / determinant;
        Hit& hit = (*hits)[(static_cast<size_t>(y) * width + x) * kSamplesPerPixel + i];
        if (depth < view.near || depth > view.far || depth >= hit.depth) {
          continue;
        }
        const Eigen::Vector2d st = (1.0 - a - b) * vertex[0]->st.cast<double>() +
                                   a * vertex[1]->st.cast<double>() + b * vertex[2]->st.cast<double>();
        hit = {
            depth,
            {static_cast<int>(vertex[0]->face), std::clamp(st.x(), 0.0, 1.0), std::clamp(st.y(), 0.0, 1.0)},
            normal.dot(ray) < 0.0};
      }
    }
  }
}

// Where rays to lights start, above the receiver along its normal, in radii of the surface: far beyond what
// single precision rounds away.
constexpr double kRayOffset = 1e-5;

// Which lights reach a point.
class Visibility {
 public:
  Visibility(const PreviewScene& scene, const SurfaceTriangles& triangles, const Occlusion& occlusion)
      : mesh_(scene.dressing->mesh), triangles_(triangles), occlusion_(occlusion) {}

  // `n`: the shading normal at the point.
  [[nodiscard]] bool Reaches(const Light& light, const SurfacePoint& point, const Eigen::Vector3d& n) const {
    const Eigen::Vector3d origin = Receiver(point) + kRayOffset * triangles_.radius * n;
    if (light.kind == Light::Kind::kDirectional) {
      return !occlusion_.Occludes(origin, light.place.normalized(), std::numeric_limits<double>::infinity());
    }
    const Eigen::Vector3d to_light = light.place - triangles_.centre - origin;
    const double distance = to_light.norm();
    return distance == 0.0 || !occlusion_.Occludes(origin, to_light / distance, distance);
  }

 private:
  // Relative to the surface's centre; see preview_scene.h.
  [[nodiscard]] Eigen::Vector3d Receiver(const SurfacePoint& point) const {
    const Eigen::Vector3d flat = OnTriangle(point);
    const std::array<double, 4> weights = {(1.0 - point.s) * (1.0 - point.q), point.s * (1.0 - point.q),
                                           point.s * point.q, (1.0 - point.s) * point.q};
    Eigen::Vector3d raise = Eigen::Vector3d::Zero();
    for (int k = 0; k < 4; ++k) {
      const Eigen::Vector3d normal = mesh_.normals[mesh_.quads[point.face][k]].cast<double>();
      raise += weights[k] * std::max((Corner(point.face, k) - flat).dot(normal), 0.0) * normal;
    }
    const double diagonal = 0.5 * ((Corner(point.face, 2) - Corner(point.face, 0)).norm() +
                                   (Corner(point.face, 3) - Corner(point.face, 1)).norm());
    return flat + raise * std::min(1.0, kMostRaise * diagonal / std::max(raise.norm(), 1e-20));
  }

  [[nodiscard]] Eigen::Vector3d Corner(int face, int k) const {
    return mesh_.positions[mesh_.quads[face][k]].cast<double>() - triangles_.centre;
  }

  // The point (s, q) of the face's triangles.
  [[nodiscard]] Eigen::Vector3d OnTriangle(const SurfacePoint& point) const {
    const int n = triangles_.cells;
    const int i = std::min(static_cast<int>(point.s * n), n - 1);
    const int j = std::min(static_cast<int>(point.q * n), n - 1);
    const double x = point.s * n - i;
    const double y = point.q * n - j;
    const size_t first = static_cast<size_t>(point.face) * (n + 1) * (n + 1);
    const auto vertex = [&](int di, int dj) -> Eigen::Vector3d {
      return triangles_.vertices[first + static_cast<size_t>(j + dj) * (n + 1) + i + di]
          .position.cast<double>();
    };
    return x > y ? (1.0 - x) * vertex(0, 0) + (x - y) * vertex(1, 0) + y * vertex(1, 1)
                 : (1.0 - y) * vertex(0, 0) + (y - x) * vertex(0, 1) + x * vertex(1, 1);
  }

  const QuadMesh& mesh_;
  const SurfaceTriangles& triangles_;
  const Occlusion& occlusion_;
};

// What the lights add up to, and which of the first 64 reach the point.
struct Shaded {
  Eigen::Array3d radiance = Eigen::Array3d::Zero();
  uint64_t lit = 0;
};

// An environment's texels that are not black.
struct TexelLights {
  explicit TexelLights(const ReferenceEnvironment& reference) : negative_values(reference.negative_values) {
    if (reference.environment == nullptr) {
      return;
    }
    const Environment& environment = *reference.environment;
    for (int y = 0; y < environment.grid().height(); ++y) {
      for (int x = 0; x < environment.grid().width(); ++x) {
        const Eigen::Array3d irradiance =
            environment.TexelRadiance(x, y) * environment.grid().SolidAngle(x, y);
        if (irradiance.maxCoeff() > 0.0) {
          lights.push_back({.place = environment.TexelDirection(x, y), .irradiance = irradiance.matrix()});
        }
      }
    }
  }

  std::vector<Light> lights;
  NegativeValues negative_values;
};

class Shader {
 public:
  // `visibility` is none where the scene has no shadows.
  Shader(const PreviewScene& scene, const DressedSurface& surface, const Decoder& decoder,
         const ViewFrame& view, const Visibility* visibility, const TexelLights& texels)
      : scene_(scene),
        surface_(surface),
        decoder_(decoder),
        view_(view),
        visibility_(visibility),
        texels_(texels) {}

  // Of one group's samples, all on the front of one face.
  [[nodiscard]] Shaded Shade(std::span<const SurfacePoint> samples) const {
    SurfacePoint mean{samples[0].face, 0.0, 0.0};
    for (const SurfacePoint& sample : samples) {
      mean.s += sample.s / static_cast<double>(samples.size());
      mean.q += sample.q / static_cast<double>(samples.size());
    }
    double radius = 0.0;
    for (const SurfacePoint& sample : samples) {
      radius = std::max(radius, std::hypot(sample.s - mean.s, sample.q - mean.q));
    }
    std::vector<Tap> taps;
    if (scene_.filter == Filter::kNearest) {
      taps = {surface_.NearestTap(mean)};
    } else if (scene_.mips != nullptr) {
      taps = surface_.MipTaps(mean, LevelAt(mean));
    } else if (radius * surface_.tile_set().tile_size <= kBilinearRadiusTexels) {
      const Taps bilinear = surface_.BilinearTaps(mean);
      taps.assign(bilinear.begin(), bilinear.end());
    } else {
      for (const SurfacePoint& sample : samples) {
        taps.push_back(surface_.NearestTap(sample));
        taps.back().weight = 1.0 / static_cast<double>(samples.size());
      }
    }
    const SurfaceFrame frame = surface_.FrameAt(mean);
    const Eigen::Vector3d to_eye = (scene_.camera.eye - frame.position).normalized();
    const BlendedTaps blend(surface_, taps);
    Shaded shaded;
    for (size_t i = 0; i < scene_.lights.size(); ++i) {
      const Light& light = scene_.lights[i];
      if (visibility_ != nullptr && !visibility_->Reaches(light, mean, frame.n)) {
        continue;
      }
      shaded.lit |= i < 64 ? uint64_t{1} << i : 0;
      Eigen::Vector3d to_light = light.place;
      double falloff = 1.0;
      if (light.kind == Light::Kind::kPoint) {
        to_light -= frame.position;
        falloff = 1.0 / std::max(to_light.squaredNorm(), 1e-24);
      }
      shaded.radiance += ReflectanceOfTaps(blend, decoder_, frame, to_light.normalized(), to_eye).max(0.0) *
                         light.irradiance.array() * (falloff / kPi);
    }
    shaded.radiance += UnderTexels(blend, mean, frame, to_eye);
    if (scene_.frequency_light != nullptr) {
      shaded.radiance += RadianceOfTaps(blend, decoder_, frame, *scene_.frequency_light, to_eye).max(0.0);
    }
    return shaded;
  }

 private:
  [[nodiscard]] Eigen::Array3d UnderTexels(const BlendedTaps& taps, const SurfacePoint& point,
                                           const SurfaceFrame& frame, const Eigen::Vector3d& to_eye) const {
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    for (const Light& texel : texels_.lights) {
      if (frame.n.dot(texel.place) <= 0.0 ||
          (visibility_ != nullptr && !visibility_->Reaches(texel, point, frame.n))) {
        continue;
      }
      const Eigen::Array3d value = ReflectanceOfTaps(taps, decoder_, frame, texel.place, to_eye);
      sum += (texels_.negative_values == NegativeValues::kClamp ? value.max(0.0) : value) *
             texel.irradiance.array() / kPi;
    }
    return texels_.negative_values == NegativeValues::kClamp ? sum : sum.max(0.0);
  }

  // The mip level that shows a pixel's share of the surface as about one texel; infinite edge on.
  [[nodiscard]] double LevelAt(const SurfacePoint& point) const {
    const Eigen::Vector3d from_eye = surface_.PositionAt(point) - view_.eye;
    const Eigen::Matrix<double, 3, 2> tangents = surface_.TangentsAt(point);
    const double depth = -from_eye.dot(view_.back);
    // Pixels by (s, q): the derivatives of x / depth and y / depth.
    const double focal_pixels = 0.5 * scene_.height / view_.tan_half_fov_y;
    const auto row = [&](const Eigen::Vector3d& axis) -> Eigen::RowVector2d {
      return focal_pixels / (depth * depth) *
             (depth * axis.transpose() * tangents + from_eye.dot(axis) * view_.back.transpose() * tangents);
    };
    Eigen::Matrix2d pixels;
    pixels.row(0) = row(view_.right);
    pixels.row(1) = row(view_.up);
    const Eigen::Vector2d axes = pixels.jacobiSvd().singularValues();
    const double w = surface_.tile_set().tile_size;
    const double shorter = w / axes[0];
    const double longer = w / axes[1];
    return std::log2(std::max(shorter, longer / kMipAnisotropy)) - kMipBias;
  }

  const PreviewScene& scene_;
  const DressedSurface& surface_;
  const Decoder& decoder_;
  const ViewFrame& view_;
  const Visibility* visibility_;
  const TexelLights& texels_;
};

// One pixel from its samples.
void ShadePixel(const Shader& shader, std::span<const Hit> samples, size_t pixel, ReferencePicture& picture) {
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  int covered = 0;
  picture.nearest[pixel] = std::numeric_limits<double>::infinity();
  picture.lit_everywhere[pixel] = ~uint64_t{0};
  std::array<bool, kSamplesPerPixel> done = {};
  for (int i = 0; i < kSamplesPerPixel; ++i) {
    picture.nearest[pixel] = std::min(picture.nearest[pixel], samples[i].depth);
    picture.farthest[pixel] = std::max(picture.farthest[pixel], samples[i].depth);
    if (done[i] || !std::isfinite(samples[i].depth)) {
      continue;
    }
    std::vector<SurfacePoint> group;
    for (int j = i; j < kSamplesPerPixel; ++j) {
      if (!done[j] && std::isfinite(samples[j].depth) && samples[j].point.face == samples[i].point.face &&
          samples[j].front == samples[i].front) {
        group.push_back(samples[j].point);
        done[j] = true;
      }
    }
    covered += static_cast<int>(group.size());
    if (samples[i].front) {
      const Shaded shaded = shader.Shade(group);
      sum += static_cast<double>(group.size()) * shaded.radiance;
      picture.lit_somewhere[pixel] |= shaded.lit;
      picture.lit_everywhere[pixel] &= shaded.lit;
    }
  }
  float* out = picture.image.pixels.data() + pixel * 4;
  for (int c = 0; c < 3 && covered > 0; ++c) {
    out[c] = static_cast<float>(sum[c] / covered);
  }
  out[3] = static_cast<float>(covered) / kSamplesPerPixel;
}

}  // namespace

absl::StatusOr<ReferencePicture> RenderReferenceWithDepth(const PreviewScene& scene,
                                                          const RunContext& context,
                                                          const ReferenceEnvironment& environment) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  TESSERA_ASSIGN_OR_RETURN(const DressedSurface surface,
                           DressedSurface::Create(*scene.dressing, *scene.tile_set, scene.mips));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(scene.tile_set->btfels));
  const SurfaceTriangles triangles = TriangulateSurface(scene.dressing->mesh);
  const ViewFrame view = MakeViewFrame(scene.camera, triangles);
  const Rays rays(view, triangles.centre, scene.width, scene.height);
  std::unique_ptr<Occlusion> occlusion;
  std::optional<Visibility> visibility;
  if (scene.shadows.has_value()) {
    TESSERA_ASSIGN_OR_RETURN(occlusion, Occlusion::Create(triangles));
    visibility.emplace(scene, triangles, *occlusion);
  }
  const TexelLights texels(environment);
  const Shader shader(scene, surface, *decoder, view, visibility.has_value() ? &*visibility : nullptr,
                      texels);

  ReferencePicture picture;
  picture.image = Image(scene.width, scene.height, 4);
  picture.nearest.assign(static_cast<size_t>(scene.width) * scene.height, 0.0);
  picture.farthest = picture.nearest;
  picture.lit_somewhere.assign(picture.nearest.size(), 0);
  picture.lit_everywhere = picture.lit_somewhere;
  std::vector<Hit> hits(picture.nearest.size() * kSamplesPerPixel);
  constexpr int kRowsPerTask = 8;
  ParallelFor(context, 0, scene.height, kRowsPerTask, [&](int64_t begin, int64_t end) {
    for (size_t i = 0; i < triangles.indices.size(); i += 3) {
      DrawTriangle(triangles, i, rays, view, scene.width, static_cast<int>(begin), static_cast<int>(end) - 1,
                   &hits);
    }
    for (int64_t pixel = begin * scene.width; pixel < end * scene.width && context.CheckStop().ok();
         ++pixel) {
      const std::span<const Hit> samples(hits.data() + pixel * kSamplesPerPixel, kSamplesPerPixel);
      ShadePixel(shader, samples, static_cast<size_t>(pixel), picture);
    }
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  return picture;
}

absl::StatusOr<Image> RenderReference(const PreviewScene& scene, const RunContext& run_context) {
  TESSERA_ASSIGN_OR_RETURN(ReferencePicture picture, RenderReferenceWithDepth(scene, run_context));
  return std::move(picture.image);
}

}  // namespace tessera
