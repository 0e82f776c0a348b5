#include "btf/remesh/creases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <utility>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

struct EdgeSide {
  uint32_t low = 0;
  uint32_t high = 0;
  uint32_t triangle = 0;

  friend auto operator<=>(const EdgeSide&, const EdgeSide&) = default;
};

uint32_t PieceOf(std::vector<uint32_t>& parent, uint32_t v) {
  while (parent[v] != v) {
    parent[v] = parent[parent[v]];
    v = parent[v];
  }
  return v;
}

}  // namespace

absl::StatusOr<Creases> FindCreases(const std::vector<Eigen::Vector3d>& positions,
                                    std::span<const Triangle> triangles, const ClosestPoint& surface,
                                    double least_angle_rad, double least_length) {
  std::vector<EdgeSide> sides;
  sides.reserve(3 * triangles.size());
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(triangles[i][k], triangles[i][(k + 1) % 3]);
      sides.push_back({low, high, i});
    }
  }
  std::sort(sides.begin(), sides.end());
  std::vector<uint32_t> parent(positions.size());
  std::iota(parent.begin(), parent.end(), 0u);
  std::vector<std::array<uint32_t, 2>> edges;
  for (size_t i = 0; i + 1 < sides.size(); i += 2) {
    const Eigen::Vector3d& a = surface.normals()[sides[i].triangle];
    const Eigen::Vector3d& b = surface.normals()[sides[i + 1].triangle];
    if (!a.isZero() && !b.isZero() && a.dot(b) < std::cos(least_angle_rad)) {
      edges.push_back({sides[i].low, sides[i].high});
      parent[PieceOf(parent, sides[i].low)] = PieceOf(parent, sides[i].high);
    }
  }
  std::vector<double> length(positions.size(), 0.0);
  for (const auto& [a, b] : edges) {
    length[PieceOf(parent, a)] += (positions[a] - positions[b]).norm();
  }
  std::erase_if(edges, [&](const auto& edge) { return length[PieceOf(parent, edge[0])] < least_length; });

  Creases creases;
  if (edges.empty()) {
    return creases;
  }
  std::vector<Triangle> segments;
  std::vector<uint32_t> count(positions.size(), 0);
  std::vector<Eigen::Vector3d> sum(positions.size(), Eigen::Vector3d::Zero());  // of unit vectors along edges
  for (const auto& [a, b] : edges) {
    segments.push_back({a, b, b});
    const Eigen::Vector3d along = (positions[b] - positions[a]).normalized();
    sum[a] += along;
    sum[b] -= along;
    ++count[a];
    ++count[b];
  }
  // Two unit vectors at a right angle or sharper add up to a length of sqrt(2) or more.
  for (size_t v = 0; v < positions.size(); ++v) {
    if (count[v] > 0 && (count[v] != 2 || sum[v].squaredNorm() >= 2.0)) {
      creases.corners.push_back(positions[v]);
    }
  }
  TESSERA_ASSIGN_OR_RETURN(creases.lines, ClosestPoint::Create(positions, std::move(segments)));
  return creases;
}

}  // namespace tessera
