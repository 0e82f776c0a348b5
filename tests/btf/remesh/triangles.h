// Triangle meshes that tests of several modules share.
#pragma once

#include <vector>

#include "btf/remesh/triangle_mesh.h"
#include "btf/wang/quad_mesh.h"

namespace tessera {

// Each quad as two triangles.
inline TriangleMesh Halved(const QuadMesh& quads) {
  return {.positions = quads.positions, .triangles = HalvesOf(quads.quads)};
}

// Twelve triangles, counter-clockwise seen from outside.
inline TriangleMesh Box(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  QuadMesh quads;
  for (int i = 0; i < 8; ++i) {
    quads.positions.emplace_back((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                                 (i & 4) != 0 ? high.z() : low.z());
  }
  quads.quads = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  return Halved(quads);
}

inline std::vector<Eigen::Vector3d> DoublesOf(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> positions;
  for (const Eigen::Vector3f& p : mesh.positions) {
    positions.emplace_back(p.cast<double>());
  }
  return positions;
}

// Both meshes in one.
inline TriangleMesh Together(TriangleMesh a, const TriangleMesh& b) {
  const auto base = static_cast<uint32_t>(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const Triangle& t : b.triangles) {
    a.triangles.push_back({t[0] + base, t[1] + base, t[2] + base});
  }
  return a;
}

}  // namespace tessera
