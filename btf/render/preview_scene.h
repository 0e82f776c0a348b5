// What both renderers of a preview share: the checked scene, its triangles, its view and how a pixel is
// sampled. Everything that makes a value (frames, filtering, decoding) they do apart.
//
// A pixel has four samples, in a rotated grid. The covered samples of one face form a group, shaded once at
// the mean of their (s, q) under that point's frame, view and light:
//   bilinearly, when they lie within kBilinearRadiusTexels of their mean (up to two texels a pixel);
//   else as the mean of the texels that the samples lie in, which filters what a footprint of 2 x 2 texels
//   would miss.
// With mip levels, instead of the two, by bilinear footprints of one or two levels at the mean. How many
// texels a pixel covers there follows from the derivatives of (s, q) by the pixel's place: an ellipse whose
// longer axis may count at most kMipAnisotropy times the shorter one. The level is log2 of that number less
// kMipBias, between the tile set itself (0) and its coarsest level.
// With Filter::kNearest a group shows the one texel that its mean lies in.
// The pixel is the mean over its covered samples; alpha is their share.
//
// With shadows a light counts where it is seen from, once a group. Flat faces would shadow themselves in
// facets where a smooth surface turns away from a light; so what receives light is not the point of the
// triangle at the mean (s, q) but that point raised to the surface that the normals tell of [Hanika2021]: it
// is projected up onto the tangent plane of each vertex of the face above it, and the four are blended with
// the bilinear weights. It is raised by at most kMostRaise times the mean diagonal of the face, which bounds
// what faces whose normals do not go with their shape can do.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <absl/status/status.h>
#include <Eigen/Core>

#include "btf/render/preview.h"

namespace tessera {

inline constexpr int kSamplesPerPixel = 4;
// From the pixel centre, in pixels, x right and y down.
inline constexpr std::array<std::array<double, 2>, kSamplesPerPixel> kSampleOffsets = {
    {{-0.125, -0.375}, {0.375, -0.125}, {-0.375, 0.125}, {0.125, 0.375}}};
// The samples lie 0.395 pixels from the centre: 0.8 texels are reached at two texels a pixel.
inline constexpr double kBilinearRadiusTexels = 0.8;

// A bilinear footprint at level l spreads by 4^l / 4 (variance, in texels), a pixel that covers n texels by
// n^2 / 12, beside the 1 / 6 of the bilinear texels that it covers: with this bias the same for n = 2, a
// little more beyond. More anisotropy would let what lies along the longer axis alias, less would blur what
// lies along the shorter one.
inline constexpr double kMipBias = 0.5;
inline constexpr double kMipAnisotropy = 2.0;

// Smooth surfaces whose normals turn by half a right angle from vertex to vertex are raised by less.
inline constexpr double kMostRaise = 0.1;

inline constexpr int kLeastPreviewSide = 16;
inline constexpr int kMostPreviewSide = 8192;
inline constexpr double kLeastFieldOfViewDeg = 0.1;
inline constexpr double kMostFieldOfViewDeg = 170.0;
inline constexpr double kLeastOrbitDistance = 0.01;
inline constexpr double kMostOrbitDistance = 1000.0;
inline constexpr size_t kMostPreviewLights = 4096;
inline constexpr int kLeastShadowMap = 64;
inline constexpr int kMostShadowMap = 2048;

// Errors: INVALID_ARGUMENT naming the member of `scene`, its value and the limit.
[[nodiscard]] absl::Status CheckScene(const PreviewScene& scene);

struct SurfaceVertex {
  Eigen::Vector3f position;  // relative to SurfaceTriangles::centre
  Eigen::Vector2f st;        // (s, q) of the face
  uint32_t face = 0;
};

// Each face cut into cells x cells bilinear patches of two triangles: enough that (s, q), linear in a
// triangle, follows a skewed face. The same number for every face, so that no edge has a vertex on one side
// only.
struct SurfaceTriangles {
  Eigen::Vector3d centre;  // of the bounding box
  double radius = 0.0;     // of the bounding sphere about it
  int cells = 1;
  std::vector<SurfaceVertex> vertices;
  std::vector<uint32_t> indices;  // counter-clockwise seen from the front
};
[[nodiscard]] SurfaceTriangles TriangulateSurface(const QuadMesh& mesh);

// The camera as an orthonormal frame, with the depth range that holds the surface.
struct ViewFrame {
  Eigen::Vector3d eye;
  Eigen::Vector3d right;
  Eigen::Vector3d up;
  Eigen::Vector3d back;  // from the target to the eye
  double tan_half_fov_y = 0.0;
  double near = 0.0;
  double far = 0.0;
};
[[nodiscard]] ViewFrame MakeViewFrame(const Camera& camera, const SurfaceTriangles& triangles);

}  // namespace tessera
