// Where the shadow maps of a light look from.
//
// A directional light has one orthographic map about the bounding sphere of the surface. So has a point light
// in perspective, while it is at least kOneMapDistance radii from the sphere's centre; nearer ones have six
// maps, one a side of a cube about them.
//
// The bias: what receives light is moved along its shading normal by kShadowBiasTexels times the width of a
// map's texel at its place. The comparison reads 2 x 2 texels, whose centres lie within sqrt(2) texels of the
// point across the map; what lies in its tangent plane therefore never shadows it, however grazing the light.
// The rest is for curvature and rounding. The price: shadows begin up to kShadowBiasTexels + sqrt(2) texels
// of the map, measured across the light, from where an occluder touches.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "btf/render/preview.h"
#include "btf/render/preview_scene.h"

namespace tessera {

inline constexpr double kShadowBiasTexels = 2.0;
inline constexpr double kOneMapDistance = 1.5;
inline constexpr int kMostMapsPerLight = 6;

struct ShadowView {
  // Clip space as GL has it; the surface relative to SurfaceTriangles::centre.
  Eigen::Matrix4d clip_from_surface;
  double texel_width = 0.0;  // on the surface, where w is 1; grows with w
};

// One view, or six in the order +x -x +y -y +z -z of the surface seen from the light. `map_size` in texels on
// a side. The light as CheckScene wants it. Cost: constant.
[[nodiscard]] std::vector<ShadowView> ShadowViewsOf(const Light& light, const SurfaceTriangles& triangles,
                                                    int map_size);

}  // namespace tessera
