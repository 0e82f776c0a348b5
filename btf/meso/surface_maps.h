// A periodic height field with its material, as the tracer sees it.
//
//   vertex (i, j) of row-major n x n fields, n = size * cells_per_texel, lies at
//     x = i / cells_per_texel,  y = size - j / cells_per_texel     (row 0 on top, y up)
//   cell (i, j) has vertices (i..i+1, j..j+1), indices modulo n, and is split into two facets; the diagonal
//   alternates with the parity of i + j, so that neither diagonal direction is preferred:
//
//     even  A---B      odd  A---B      A = (i, j), B = (i+1, j)
//           | \ |           | / |      C = (i, j+1), D = (i+1, j+1)
//           C---D           C---D
//     facet 0: A C D        A C B      facet index = 2 (j n + i) + k
//     facet 1: A D B        B C D
//
// Lengths are texels. The reference plane is z = 0.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tessera {

struct SurfaceMaps {
  int size = 0;                  // texels per side
  int cells_per_texel = 1;       // along each axis
  std::vector<float> height;     // [n][n]
  std::vector<float> albedo;     // [n][n][3], diffuse, linear RGB in [0, 1]
  std::vector<float> roughness;  // [n][n], in [0, 1]
  // Fresnel reflectance at normal incidence; 0 switches the specular lobe off.
  float specular_f0 = 0.04F;

  [[nodiscard]] int resolution() const { return size * cells_per_texel; }
  [[nodiscard]] int64_t num_facets() const { return int64_t{2} * resolution() * resolution(); }
};

// The offsets (in cells, along columns and rows) of a facet's three vertices from its cell's vertex A,
// counter-clockwise seen from above.
using FacetCorners = std::array<std::array<int, 2>, 3>;
inline FacetCorners CornersOfFacet(int i, int j, int k) {
  if (((i + j) & 1) == 0) {
    return k == 0 ? FacetCorners{{{0, 0}, {0, 1}, {1, 1}}} : FacetCorners{{{0, 0}, {1, 1}, {1, 0}}};
  }
  return k == 0 ? FacetCorners{{{0, 0}, {0, 1}, {1, 0}}} : FacetCorners{{{1, 0}, {0, 1}, {1, 1}}};
}

// Shifts the heights so that their median lies on the reference plane z = 0. The median minimises the mean
// absolute parallax.
void CentreOnReferencePlane(SurfaceMaps& maps);

}  // namespace tessera
