#include "btf/wang/shapes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <Eigen/Geometry>

#include "btf/base/status_macros.h"
#include "btf/math/conventions.h"
#include "btf/wang/catmull_clark.h"
#include "btf/wang/subdivide.h"

namespace tessera {
namespace {

constexpr int kPlaneQuads = 16;  // a side
constexpr int kTorusMajorQuads = 32;
constexpr int kTorusMinorQuads = 14;
constexpr double kTorusMajorRadius = 0.7;
constexpr double kTorusMinorRadius = 0.3;
constexpr int kCubeQuads = 10;          // along each edge of the cube
constexpr uint32_t kGenus3Quads = 600;  // about
constexpr int kGenus3Smoothings = 3;

QuadMesh MakePlane() {
  QuadMesh mesh;
  for (int j = 0; j <= kPlaneQuads; ++j) {
    for (int i = 0; i <= kPlaneQuads; ++i) {
      mesh.positions.emplace_back(2.0f * i / kPlaneQuads - 1.0f, 2.0f * j / kPlaneQuads - 1.0f, 0.0f);
      mesh.normals.emplace_back(0.0f, 0.0f, 1.0f);
    }
  }
  for (uint32_t j = 0; j < kPlaneQuads; ++j) {
    for (uint32_t i = 0; i < kPlaneQuads; ++i) {
      const uint32_t corner = j * (kPlaneQuads + 1) + i;
      mesh.quads.push_back({corner, corner + 1, corner + kPlaneQuads + 2, corner + kPlaneQuads + 1});
    }
  }
  return mesh;
}

// Sides 0 run around the y axis (counter-clockwise seen from above), sides 1 around the tube, upwards
// outside.
QuadMesh MakeTorus() {
  QuadMesh mesh;
  for (int i = 0; i < kTorusMajorQuads; ++i) {
    const double u = 2.0 * kPi * i / kTorusMajorQuads;
    const Eigen::Vector3d outward(std::sin(u), 0.0, std::cos(u));
    for (int j = 0; j < kTorusMinorQuads; ++j) {
      const double v = 2.0 * kPi * j / kTorusMinorQuads;
      const Eigen::Vector3d normal = std::cos(v) * outward + std::sin(v) * Eigen::Vector3d::UnitY();
      mesh.positions.push_back((kTorusMajorRadius * outward + kTorusMinorRadius * normal).cast<float>());
      mesh.normals.push_back(normal.cast<float>());
    }
  }
  const auto vertex = [](int i, int j) {
    return static_cast<uint32_t>((i % kTorusMajorQuads) * kTorusMinorQuads + j % kTorusMinorQuads);
  };
  for (int j = 0; j < kTorusMinorQuads; ++j) {
    for (int i = 0; i < kTorusMajorQuads; ++i) {
      mesh.quads.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
    }
  }
  return mesh;
}

// Vertices shared between the faces of the cube are found by their integer coordinates.
QuadMesh MakeCubeSphere() {
  constexpr int kSide = kCubeQuads + 1;
  QuadMesh mesh;
  std::vector<int> index(kSide * kSide * kSide, -1);
  const auto vertex = [&](const Eigen::Vector3i& at) {
    int& found = index[(at.x() * kSide + at.y()) * kSide + at.z()];
    if (found < 0) {
      found = static_cast<int>(mesh.positions.size());
      // Equal angles instead of equal lengths: quads near the cube's corners would be far smaller.
      const Eigen::Array3d angle = (2.0 * at.cast<double>().array() / kCubeQuads - 1.0) * (kPi / 4.0);
      mesh.positions.push_back(angle.tan().matrix().normalized().cast<float>());
      mesh.normals.push_back(mesh.positions.back());
    }
    return static_cast<uint32_t>(found);
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool far_side : {true, false}) {
      // (s, t, axis) right-handed on the far side, so that faces are counter-clockwise seen from outside.
      Eigen::Vector3i s = Eigen::Vector3i::Unit((axis + 1) % 3);
      Eigen::Vector3i t = Eigen::Vector3i::Unit((axis + 2) % 3);
      if (!far_side) {
        std::swap(s, t);
      }
      const Eigen::Vector3i origin =
          far_side ? Eigen::Vector3i(kCubeQuads * Eigen::Vector3i::Unit(axis)) : Eigen::Vector3i(0, 0, 0);
      for (int j = 0; j < kCubeQuads; ++j) {
        for (int i = 0; i < kCubeQuads; ++i) {
          const Eigen::Vector3i corner = origin + i * s + j * t;
          mesh.quads.push_back(
              {vertex(corner), vertex(corner + s), vertex(corner + s + t), vertex(corner + t)});
        }
      }
    }
  }
  return mesh;
}

// Three hexagons about a common corner, each with a hexagonal hole, as a thick plate, then rounded:
//
//      ___         18 quads in front, 18 behind, 12 on the rim, 3 x 6 in the holes:
//     /   \___     V - E + F = 62 - 132 + 66 = -4, that is three holes.
//     \___/   \.
//     /   \___/
//     \___/
absl::StatusOr<QuadMesh> MakeGenus3() {
  constexpr double kHoleRadius = 0.42;  // of the hexagon's circumradius, 1
  constexpr double kHalfThickness = 0.36;
  std::vector<Eigen::Vector2d> flat;
  const auto shared_vertex = [&](const Eigen::Vector2d& at) {
    constexpr double kSamePoint = 1e-6;
    for (size_t i = 0; i < flat.size(); ++i) {
      if ((flat[i] - at).norm() < kSamePoint) {
        return static_cast<uint32_t>(i);
      }
    }
    flat.push_back(at);
    return static_cast<uint32_t>(flat.size() - 1);
  };
  const auto unit = [](double deg) {
    return Eigen::Vector2d(std::cos(RadFromDeg(deg)), std::sin(RadFromDeg(deg)));
  };
  std::vector<Quad> rings;  // outer, next outer, next inner, inner; counter-clockwise
  for (int h = 0; h < 3; ++h) {
    const Eigen::Vector2d centre = unit(90.0 + 120.0 * h);
    std::array<uint32_t, 6> outer{};
    std::array<uint32_t, 6> inner{};
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector2d corner = unit(90.0 + 120.0 * h + 60.0 * i);
      outer[i] = shared_vertex(centre + corner);
      inner[i] = shared_vertex(centre + kHoleRadius * corner);
    }
    for (int i = 0; i < 6; ++i) {
      rings.push_back({outer[i], outer[(i + 1) % 6], inner[(i + 1) % 6], inner[i]});
    }
  }
  const auto num_flat = static_cast<uint32_t>(flat.size());
  QuadMesh mesh;
  for (const double z : {kHalfThickness, -kHalfThickness}) {
    for (const Eigen::Vector2d& point : flat) {
      mesh.positions.push_back(Eigen::Vector3d(point.x(), point.y(), z).cast<float>());
    }
  }
  const auto on_another_ring = [&](uint32_t a, uint32_t b) {
    return std::any_of(rings.begin(), rings.end(),
                       [&](const Quad& ring) { return ring[0] == b && ring[1] == a; });
  };
  for (const auto& [a, b, c, d] : rings) {
    mesh.quads.push_back({a, b, c, d});
    mesh.quads.push_back({num_flat + a, num_flat + d, num_flat + c, num_flat + b});
    if (!on_another_ring(a, b)) {
      mesh.quads.push_back({b, a, num_flat + a, num_flat + b});
    }
    mesh.quads.push_back({d, c, num_flat + c, num_flat + d});
  }
  mesh.normals = ComputeNormals(mesh);
  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency plate, BuildAdjacency(mesh));
  mesh = CatmullClark(mesh, plate);
  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency coarse, BuildAdjacency(mesh));
  const Chords chords = FindChords(coarse);
  mesh = SubdivideQuads(mesh, coarse, chords, ChordCounts(mesh, chords, kGenus3Quads));
  // Only the vertex rule of Catmull-Clark is wanted: it rounds the solid and leaves the quads as large as
  // they are.
  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency adjacency, BuildAdjacency(mesh));
  for (int i = 0; i < kGenus3Smoothings; ++i) {
    const QuadMesh finer = CatmullClark(mesh, adjacency);
    std::copy_n(finer.positions.begin(), mesh.positions.size(), mesh.positions.begin());
  }
  mesh.normals = ComputeNormals(mesh);
  float radius = 0.0f;
  for (const Eigen::Vector3f& position : mesh.positions) {
    radius = std::max(radius, position.norm());
  }
  for (Eigen::Vector3f& position : mesh.positions) {
    position /= radius;
  }
  return mesh;
}

}  // namespace

absl::StatusOr<QuadMesh> BuiltinShape(std::string_view name) {
  if (name == "cube-sphere") {
    return MakeCubeSphere();
  }
  if (name == "genus3") {
    return MakeGenus3();
  }
  if (name == "plane") {
    return MakePlane();
  }
  if (name == "torus") {
    return MakeTorus();
  }
  return absl::NotFoundError(absl::StrCat(
      "no built-in shape named '", std::string(name),
      "'; known: ", absl::StrJoin(BuiltinShapeNames(), ", ", [](std::string* out, std::string_view shape) {
        out->append(shape);
      })));
}

const std::vector<std::string_view>& BuiltinShapeNames() {
  static const auto* const names =
      new std::vector<std::string_view>{"cube-sphere", "genus3", "plane", "torus"};
  return *names;
}

}  // namespace tessera
