// The facets of a height field and the surface points on them, where visibility is kept.
//
// A facet is cut into edge_parts^2 congruent parts; the surface points are the parts' centroids. In
// barycentric coordinates (u, v) of the facet, scaled by edge_parts, part (i, j, 0) is the triangle at the
// lower left of unit square (i, j) and (i, j, 1) the one at its upper right.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "btf/meso/microfacet.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

struct Facet {
  Eigen::Vector3f normal;          // unit, normal.z() > 0
  std::array<float, 3> diffuse{};  // albedo / (1 - E_avg): multiply by (1 - E(mu)) for each direction
  float roughness = 1.0F;
  float alpha_squared = 1.0F;
};

// The facets of one period, in the order of surface_maps.h.
[[nodiscard]] std::vector<Facet> MakeFacets(const SurfaceMaps& maps, const SpecularAlbedo& specular);

// The corners of a facet in space, texels.
[[nodiscard]] std::array<Eigen::Vector3f, 3> CornerPositions(const SurfaceMaps& maps, int i, int j, int k);

// The cut of every facet into parts.
class FacetParts {
 public:
  explicit FacetParts(int edge_parts);

  [[nodiscard]] int count() const { return static_cast<int>(centroids_.size()); }
  // Barycentric (u, v) of a part's centroid.
  [[nodiscard]] const std::array<float, 2>& centroid(int part) const { return centroids_[part]; }
  // The part that holds (u, v), u, v >= 0, u + v <= 1; rounding outside is moved to the nearest part.
  [[nodiscard]] int PartAt(float u, float v) const {
    const float x = u * static_cast<float>(edge_parts_);
    const float y = v * static_cast<float>(edge_parts_);
    const int i = x < 0.0F ? 0 : x > last_ ? edge_parts_ - 1 : static_cast<int>(x);
    const int j = y < 0.0F ? 0 : y > last_ ? edge_parts_ - 1 : static_cast<int>(y);
    const int upper = x - static_cast<float>(i) + y - static_cast<float>(j) > 1.0F ? 1 : 0;
    return index_[2 * (j * edge_parts_ + i) + upper];
  }

 private:
  int edge_parts_;
  float last_;
  std::vector<std::array<float, 2>> centroids_;
  std::vector<int> index_;  // [j][i][upper]
};

}  // namespace tessera
