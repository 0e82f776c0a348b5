// The picture of preview.h in double precision: triangles tested sample by sample, frames and taps of
// surface.h, the decoder of codec/decoder.h. Shares no arithmetic with the shaders.
#include "btf/render/reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
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

class Shader {
 public:
  Shader(const PreviewScene& scene, const DressedSurface& surface, const Decoder& decoder,
         const ViewFrame& view)
      : scene_(scene), surface_(surface), decoder_(decoder), view_(view) {}

  // Mean radiance of one group's samples, all on the front of one face.
  [[nodiscard]] Eigen::Array3d Radiance(std::span<const SurfacePoint> samples) const {
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
    Eigen::Array3d sum = Eigen::Array3d::Zero();
    for (const Light& light : scene_.lights) {
      Eigen::Vector3d to_light = light.place;
      double falloff = 1.0;
      if (light.kind == Light::Kind::kPoint) {
        to_light -= frame.position;
        falloff = 1.0 / std::max(to_light.squaredNorm(), 1e-24);
      }
      sum += ReflectanceOfTaps(surface_, decoder_, frame, taps, to_light.normalized(), to_eye) *
             light.irradiance.array() * (falloff / kPi);
    }
    return sum;
  }

 private:
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
};

}  // namespace

absl::StatusOr<ReferencePicture> RenderReferenceWithDepth(const PreviewScene& scene,
                                                          const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckScene(scene));
  TESSERA_ASSIGN_OR_RETURN(const DressedSurface surface,
                           DressedSurface::Create(*scene.dressing, *scene.tile_set, scene.mips));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(scene.tile_set->btfels));
  const SurfaceTriangles triangles = TriangulateSurface(scene.dressing->mesh);
  const ViewFrame view = MakeViewFrame(scene.camera, triangles);
  const Rays rays(view, triangles.centre, scene.width, scene.height);
  const Shader shader(scene, surface, *decoder, view);

  ReferencePicture picture;
  picture.image = Image(scene.width, scene.height, 4);
  picture.nearest.assign(static_cast<size_t>(scene.width) * scene.height, 0.0);
  picture.farthest = picture.nearest;
  std::vector<Hit> hits(picture.nearest.size() * kSamplesPerPixel);
  constexpr int kRowsPerTask = 8;
  ParallelFor(context, 0, scene.height, kRowsPerTask, [&](int64_t begin, int64_t end) {
    for (size_t i = 0; i < triangles.indices.size(); i += 3) {
      DrawTriangle(triangles, i, rays, view, scene.width, static_cast<int>(begin), static_cast<int>(end) - 1,
                   &hits);
    }
    for (int64_t pixel = begin * scene.width; pixel < end * scene.width; ++pixel) {
      const std::span<const Hit> samples(hits.data() + pixel * kSamplesPerPixel, kSamplesPerPixel);
      Eigen::Array3d sum = Eigen::Array3d::Zero();
      int covered = 0;
      picture.nearest[pixel] = std::numeric_limits<double>::infinity();
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
          sum += static_cast<double>(group.size()) * shader.Radiance(group);
        }
      }
      float* out = picture.image.pixels.data() + pixel * 4;
      for (int c = 0; c < 3 && covered > 0; ++c) {
        out[c] = static_cast<float>(sum[c] / covered);
      }
      out[3] = static_cast<float>(covered) / kSamplesPerPixel;
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
