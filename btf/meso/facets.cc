#include "btf/meso/facets.h"

#include <algorithm>

#include <Eigen/Geometry>

namespace tessera {

std::array<Eigen::Vector3f, 3> CornerPositions(const SurfaceMaps& maps, int i, int j, int k) {
  const int n = maps.resolution();
  const auto cells = static_cast<float>(maps.cells_per_texel);
  std::array<Eigen::Vector3f, 3> positions;
  const FacetCorners corners = CornersOfFacet(i, j, k);
  for (int c = 0; c < 3; ++c) {
    const int column = i + corners[c][0];
    const int row = j + corners[c][1];
    positions[c] = {static_cast<float>(column) / cells,
                    static_cast<float>(maps.size) - static_cast<float>(row) / cells,
                    maps.height[static_cast<size_t>(row % n) * n + column % n]};
  }
  return positions;
}

std::vector<Facet> MakeFacets(const SurfaceMaps& maps, const SpecularAlbedo& specular) {
  const int n = maps.resolution();
  std::vector<Facet> facets(static_cast<size_t>(maps.num_facets()));
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < 2; ++k) {
        Facet& facet = facets[2 * (static_cast<size_t>(j) * n + i) + k];
        const auto p = CornerPositions(maps, i, j, k);
        facet.normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
        std::array<float, 3> albedo{};
        float roughness = 0.0F;
        for (const auto& corner : CornersOfFacet(i, j, k)) {
          const size_t vertex = static_cast<size_t>((j + corner[1]) % n) * n + (i + corner[0]) % n;
          for (int c = 0; c < 3; ++c) {
            albedo[c] += maps.albedo[3 * vertex + c] / 3.0F;
          }
          roughness += maps.roughness[vertex] / 3.0F;
        }
        facet.roughness = std::max(roughness, kMinRoughness);
        const float alpha = GgxAlpha(facet.roughness);
        facet.alpha_squared = alpha * alpha;
        const float left_over = 1.0F - specular.Average(facet.roughness, maps.specular_f0);
        for (int c = 0; c < 3; ++c) {
          facet.diffuse[c] = albedo[c] / left_over;
        }
      }
    }
  }
  return facets;
}

FacetParts::FacetParts(int edge_parts)
    : edge_parts_(edge_parts),
      last_(static_cast<float>(edge_parts) - 0.5F),
      index_(static_cast<size_t>(2) * edge_parts * edge_parts) {
  const auto scale = static_cast<float>(edge_parts);
  for (int j = 0; j < edge_parts; ++j) {
    for (int i = 0; i < edge_parts; ++i) {
      for (int upper = 0; upper < 2; ++upper) {
        int& index = index_[2 * (static_cast<size_t>(j) * edge_parts + i) + upper];
        if (i + j + upper < edge_parts) {
          const float third = upper == 0 ? 1.0F / 3.0F : 2.0F / 3.0F;
          index = static_cast<int>(centroids_.size());
          centroids_.push_back(
              {(static_cast<float>(i) + third) / scale, (static_cast<float>(j) + third) / scale});
        }
      }
    }
  }
  // Squares beyond the hypotenuse hold no part: (u, v) lands there only by rounding.
  for (int j = 0; j < edge_parts; ++j) {
    for (int i = 0; i < edge_parts; ++i) {
      for (int upper = 0; upper < 2; ++upper) {
        if (i + j + upper >= edge_parts) {
          const int near_i = std::min(i, edge_parts - 1 - std::min(j, edge_parts - 1));
          index_[2 * (static_cast<size_t>(j) * edge_parts + i) + upper] =
              index_[2 * (static_cast<size_t>(j) * edge_parts + near_i)];
        }
      }
    }
  }
}

}  // namespace tessera
