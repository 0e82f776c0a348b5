// Interpolation between directions scattered over the hemisphere: their Delaunay triangulation, and the
// barycentric weights of any direction.
//
// The chart is the stereographic projection from the nadir,
//
//   p(x, y, z) = (x, y) / (1 + z),
//
// which maps the hemisphere to the unit disc, turns about the normal to turns, and circles to circles or
// lines: the Delaunay triangulation of the points in the plane is that of the directions on the sphere.
// Weights are barycentric in the chart.
//
//   auto triangles = TriangulateHemisphere(directions);
//   const HemisphereInterpolator interpolator(directions, triangles);
//   BarycentricWeights w = interpolator.Locate(light);   // f = sum over s of w.weight[s] f[w.index[s]]
//
// Nothing is extrapolated. A polar angle beyond the largest of the set is clamped to it, then a point outside
// the triangles moves to their nearest point; both maps are continuous, and so is the result everywhere.
// Source: [PCAWang] 4.4, whose equations are missing from our copy: rebuilt from its text.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "btf/math/conventions.h"

namespace tessera {

// Indices of directions, counter-clockwise seen from above. Corners repeat where directions leave no area to
// span: (a, b, b) is a segment, (a, a, a) a point.
using DirectionTriangle = std::array<int, 3>;

// Delaunay triangles that cover the convex hull of the directions in the chart; segments along the line if
// all lie on one, up to 1e-6; a single point if there is but one. Of directions closer than 1e-6 in the chart
// only the first is used. Where four or more lie on one circle, any triangulation of them is Delaunay, and
// the order of the input decides. At least one direction, with polar angles in [0, pi/2]. Same input, same
// triangles. Cost: n^2 at most, for the usual hundreds of directions below a millisecond.
[[nodiscard]] std::vector<DirectionTriangle> TriangulateHemisphere(std::span<const Direction> directions);

// The chart: (x, y) / (1 + z). `direction` is unit, z >= 0.
[[nodiscard]] inline Eigen::Vector2d StereographicPoint(const Eigen::Vector3d& direction) {
  return direction.head<2>() / (1.0 + direction.z());
}

struct BarycentricWeights {
  std::array<int, 3> index{};
  std::array<double, 3> weight{};  // >= 0, their sum is 1
};

// Immutable after construction, safe to share between threads.
class HemisphereInterpolator {
 public:
  // The square [-1, 1]^2 around the chart, in cells; row 0 at y = -1.
  static constexpr int kCellsPerSide = 32;

  // A corner's index, and the point of the chart.
  struct Triangle {
    DirectionTriangle index{};
    std::array<Eigen::Vector2d, 3> corner;
    double inverse_area = 0.0;  // 1 / twice the area; 0 for a segment or point
  };

  // Both not empty, indices within the directions.
  HemisphereInterpolator(std::span<const Direction> directions, std::span<const DirectionTriangle> triangles);

  // Weights of the point of all triangles nearest to the clamped direction; of triangles equally near (the
  // two at an edge) the first. `direction` is unit, z > 0.
  [[nodiscard]] BarycentricWeights Locate(const Eigen::Vector3d& direction) const;

  // Cosine and sine of the largest polar angle of all directions.
  [[nodiscard]] double cos_limit() const { return cos_limit_; }
  [[nodiscard]] double sin_limit() const { return sin_limit_; }

  // What a shader needs for the same search: triangles that may be nearest to a point of cell (column, row)
  // are cell_triangles()[cell_begin()[i] .. cell_begin()[i + 1]), i = row * kCellsPerSide + column,
  // ascending.
  [[nodiscard]] const std::vector<Triangle>& triangles() const { return triangles_; }
  [[nodiscard]] const std::vector<int>& cell_begin() const { return cell_begin_; }
  [[nodiscard]] const std::vector<int>& cell_triangles() const { return cell_triangles_; }

 private:
  void FillCells();

  double cos_limit_ = 1.0;
  double sin_limit_ = 0.0;
  std::vector<Triangle> triangles_;
  std::vector<int> cell_begin_;
  std::vector<int> cell_triangles_;
};

}  // namespace tessera
