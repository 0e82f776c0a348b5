#include "btf/remesh/triangle_mesh.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <string>

#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Side `side` % 3 of triangle `side` / 3.
struct Side {
  uint32_t low = 0;
  uint32_t high = 0;
  uint32_t side = 0;

  [[nodiscard]] bool SameEdge(const Side& other) const { return low == other.low && high == other.high; }
  friend auto operator<=>(const Side&, const Side&) = default;
};

uint32_t StartOf(const TriangleMesh& mesh, uint32_t side) {
  return mesh.triangles[side / 3][side % 3];
}
uint32_t EndOf(const TriangleMesh& mesh, uint32_t side) {
  return mesh.triangles[side / 3][(side % 3 + 1) % 3];
}

absl::Status CheckTriangles(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) {
    return absl::InvalidArgumentError("the mesh has no faces");
  }
  if (mesh.positions.size() > kMaxMeshVertices || mesh.triangles.size() > kMaxMeshTriangles) {
    return absl::ResourceExhaustedError(absl::StrCat("the mesh has ", mesh.positions.size(), " vertices and ",
                                                     mesh.triangles.size(), " triangles; the limits are ",
                                                     kMaxMeshVertices, " and ", kMaxMeshTriangles));
  }
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    if (!mesh.positions[v].allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat("vertex ", v + 1, ": the position is not finite"));
    }
  }
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Triangle& triangle = mesh.triangles[i];
    for (int k = 0; k < 3; ++k) {
      if (triangle[k] >= mesh.positions.size()) {
        return absl::InvalidArgumentError(
            absl::StrCat("triangle ", i + 1, ": vertex ", uint64_t{triangle[k]} + 1,
                         " does not exist; the mesh has ", mesh.positions.size()));
      }
      if (triangle[k] == triangle[(k + 1) % 3]) {
        return absl::InvalidArgumentError(
            absl::StrCat("triangle ", i + 1, ": vertex ", uint64_t{triangle[k]} + 1, " occurs twice"));
      }
    }
  }
  return absl::OkStatus();
}

// [3 triangle + side]: the side of the other triangle on the same edge, whichever way it runs.
absl::StatusOr<std::vector<uint32_t>> SidesAcross(const TriangleMesh& mesh) {
  TESSERA_RETURN_IF_ERROR(CheckTriangles(mesh));
  std::vector<Side> sides(3 * mesh.triangles.size());
  for (uint32_t side = 0; side < sides.size(); ++side) {
    const auto [low, high] = std::minmax({StartOf(mesh, side), EndOf(mesh, side)});
    sides[side] = {low, high, side};
  }
  std::sort(sides.begin(), sides.end());
  std::vector<uint32_t> across(sides.size(), kNone);
  for (size_t i = 0; i < sides.size();) {
    size_t end = i + 1;
    while (end < sides.size() && sides[end].SameEdge(sides[i])) {
      ++end;
    }
    const std::string edge = end - i == 2 ? "" : EdgeName(mesh.positions, sides[i].low, sides[i].high);
    if (end - i == 1) {
      return absl::InvalidArgumentError(absl::StrCat("not closed: only triangle ", sides[i].side / 3 + 1,
                                                     " lies along the ", edge,
                                                     "; only closed surfaces can be remeshed"));
    }
    if (end - i > 2) {
      return absl::InvalidArgumentError(
          absl::StrCat("not a manifold: the ", edge, " is shared by ", end - i, " triangles; expected 2"));
    }
    across[sides[i].side] = sides[i + 1].side;
    across[sides[i + 1].side] = sides[i].side;
    i = end;
  }
  return across;
}

double SignedVolume(const TriangleMesh& mesh) {
  const Eigen::Vector3d origin = mesh.positions[mesh.triangles[0][0]].cast<double>();
  double volume = 0.0;
  for (const Triangle& triangle : mesh.triangles) {
    const Eigen::Vector3d a = mesh.positions[triangle[0]].cast<double>() - origin;
    const Eigen::Vector3d b = mesh.positions[triangle[1]].cast<double>() - origin;
    const Eigen::Vector3d c = mesh.positions[triangle[2]].cast<double>() - origin;
    volume += a.dot(b.cross(c)) / 6.0;
  }
  return volume;
}

}  // namespace

std::vector<Triangle> HalvesOf(std::span<const Quad> quads) {
  std::vector<Triangle> halves;
  halves.reserve(2 * quads.size());
  for (const Quad& quad : quads) {
    halves.push_back({quad[0], quad[1], quad[2]});
    halves.push_back({quad[0], quad[2], quad[3]});
  }
  return halves;
}

absl::StatusOr<SurfaceTopology> CheckClosedSurface(const TriangleMesh& mesh) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> across, SidesAcross(mesh));
  for (uint32_t side = 0; side < across.size(); ++side) {
    if (StartOf(mesh, side) == StartOf(mesh, across[side])) {
      return absl::InvalidArgumentError(
          absl::StrCat("not oriented: triangles ", side / 3 + 1, " and ", across[side] / 3 + 1,
                       " run in the same direction along the ",
                       EdgeName(mesh.positions, StartOf(mesh, side), EndOf(mesh, side))));
    }
  }
  // Fans: corner k of a triangle is followed, around its vertex, by the corner at the end of the side across
  // side k.
  std::vector<bool> seen(across.size(), false);
  int64_t num_fans = 0;
  for (uint32_t start = 0; start < across.size(); ++start) {
    num_fans += !seen[start];
    for (uint32_t corner = start; !seen[corner];) {
      seen[corner] = true;
      const uint32_t other = across[corner];
      corner = other / 3 * 3 + (other + 1) % 3;
    }
  }
  SurfaceTopology topology;
  std::vector<bool> reached(mesh.triangles.size(), false);
  std::vector<uint32_t> stack;
  for (uint32_t root = 0; root < reached.size(); ++root) {
    topology.num_components += !reached[root];
    for (stack.assign(1, root); !stack.empty();) {
      const uint32_t triangle = stack.back();
      stack.pop_back();
      if (!reached[triangle]) {
        reached[triangle] = true;
        for (uint32_t side = 3 * triangle; side < 3 * triangle + 3; ++side) {
          stack.push_back(across[side] / 3);
        }
      }
    }
  }
  // Euler: V - E + F = 2 components - 2 genus, with 2 E = 3 F.
  const int64_t euler = num_fans - static_cast<int64_t>(mesh.triangles.size()) / 2;
  topology.genus = static_cast<int64_t>(topology.num_components) - euler / 2;
  return topology;
}

absl::StatusOr<size_t> OrientOutwards(TriangleMesh& mesh) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> across, SidesAcross(mesh));
  enum class State : uint8_t { kUnseen, kKept, kTurned };
  using enum State;
  std::vector<State> state(mesh.triangles.size(), kUnseen);
  std::vector<uint32_t> component;
  size_t turned = 0;
  for (uint32_t root = 0; root < state.size(); ++root) {
    if (state[root] != kUnseen) {
      continue;
    }
    state[root] = kKept;
    component.assign(1, root);
    for (size_t i = 0; i < component.size(); ++i) {
      for (uint32_t side = 3 * component[i]; side < 3 * component[i] + 3; ++side) {
        const uint32_t other = across[side];
        const bool same_direction = StartOf(mesh, side) == StartOf(mesh, other);
        const State own = state[component[i]];
        const State wanted = same_direction ? (own == kKept ? kTurned : kKept) : own;
        if (state[other / 3] == kUnseen) {
          state[other / 3] = wanted;
          component.push_back(other / 3);
        } else if (state[other / 3] != wanted) {
          return absl::InvalidArgumentError(
              absl::StrCat("not orientable: triangles ", side / 3 + 1, " and ", other / 3 + 1,
                           " cannot both be oriented along the ",
                           EdgeName(mesh.positions, StartOf(mesh, side), EndOf(mesh, side))));
        }
      }
    }
    const auto against = static_cast<size_t>(std::count_if(
        component.begin(), component.end(), [&](uint32_t triangle) { return state[triangle] == kTurned; }));
    const State to_turn = 2 * against > component.size() ? kKept : kTurned;
    for (const uint32_t triangle : component) {
      if (state[triangle] == to_turn) {
        std::swap(mesh.triangles[triangle][1], mesh.triangles[triangle][2]);
        ++turned;
      }
    }
  }
  if (SignedVolume(mesh) < 0.0) {
    for (Triangle& triangle : mesh.triangles) {
      std::swap(triangle[1], triangle[2]);
    }
    turned = mesh.triangles.size() - turned;
  }
  return turned;
}

}  // namespace tessera
