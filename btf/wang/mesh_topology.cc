#include "btf/wang/mesh_topology.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "btf/base/status_macros.h"
#include "btf/wang/half_edges.h"

namespace tessera {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

// Sides that lie on one undirected edge, at most two, regardless of direction.
absl::StatusOr<std::vector<std::array<uint32_t, 4>>> UndirectedAdjacency(const QuadMesh& mesh) {
  const std::vector<HalfEdge> half_edges = SortedHalfEdges(mesh);
  TESSERA_RETURN_IF_ERROR(CheckEdgesManifold(mesh, half_edges));
  std::vector<std::array<uint32_t, 4>> across(mesh.quads.size(), {kNone, kNone, kNone, kNone});
  for (size_t i = 0; i + 1 < half_edges.size(); ++i) {
    if (half_edges[i].SameEdge(half_edges[i + 1])) {
      const uint32_t a = half_edges[i].side;
      const uint32_t b = half_edges[i + 1].side;
      across[a / 4][a % 4] = b;
      across[b / 4][b % 4] = a;
    }
  }
  return across;
}

// The vertices at which side `corner` % 4 of face `corner` / 4 starts and ends.
std::array<uint32_t, 2> SideVertices(const QuadMesh& mesh, uint32_t corner) {
  const Quad& quad = mesh.quads[corner / 4];
  return {quad[corner % 4], quad[(corner + 1) % 4]};
}

// Labels corners (face, k) by fan: corners of one vertex that are connected through edges share a label.
std::vector<uint32_t> FanOfCorner(const QuadAdjacency& adjacency, size_t num_faces, uint32_t* num_fans) {
  std::vector<uint32_t> fan(num_faces * 4, kNone);
  *num_fans = 0;
  for (uint32_t start = 0; start < fan.size(); ++start) {
    if (fan[start] != kNone) {
      continue;
    }
    const uint32_t label = (*num_fans)++;
    // Around the vertex counter-clockwise across the side that ends in it, then, from an open boundary,
    // clockwise across the side that starts in it.
    for (const bool counter_clockwise : {true, false}) {
      uint32_t corner = start;
      while (true) {
        fan[corner] = label;
        const uint32_t face = corner / 4;
        const uint32_t k = corner % 4;
        const QuadAdjacency::Across& next = adjacency.across[face][counter_clockwise ? (k + 3) % 4 : k];
        if (next.face < 0) {
          break;
        }
        // A neighbour's side runs against ours: across the ending side the vertex is where it starts.
        corner = 4 * static_cast<uint32_t>(next.face) +
                 static_cast<uint32_t>(counter_clockwise ? next.side : (next.side + 1) % 4);
        if (corner == start) {
          break;
        }
      }
    }
  }
  return fan;
}

size_t CountComponents(const QuadAdjacency& adjacency) {
  std::vector<bool> seen(adjacency.across.size(), false);
  std::vector<uint32_t> stack;
  size_t components = 0;
  for (uint32_t start = 0; start < seen.size(); ++start) {
    if (seen[start]) {
      continue;
    }
    ++components;
    seen[start] = true;
    stack.push_back(start);
    while (!stack.empty()) {
      const uint32_t face = stack.back();
      stack.pop_back();
      for (const QuadAdjacency::Across& across : adjacency.across[face]) {
        if (across.face >= 0 && !seen[across.face]) {
          seen[across.face] = true;
          stack.push_back(static_cast<uint32_t>(across.face));
        }
      }
    }
  }
  return components;
}

// Boundary loops, by walking each boundary side to the next one around the vertex in which it ends.
size_t CountBoundaryLoops(const QuadAdjacency& adjacency) {
  std::vector<bool> seen(adjacency.across.size() * 4, false);
  size_t loops = 0;
  for (uint32_t start = 0; start < seen.size(); ++start) {
    if (seen[start] || adjacency.across[start / 4][start % 4].face >= 0) {
      continue;
    }
    ++loops;
    uint32_t corner = start;
    while (!seen[corner]) {
      seen[corner] = true;
      // Turn about the end vertex until the next side without a neighbour.
      uint32_t candidate = 4 * (corner / 4) + (corner + 1) % 4;
      while (adjacency.across[candidate / 4][candidate % 4].face >= 0) {
        const QuadAdjacency::Across& next = adjacency.across[candidate / 4][candidate % 4];
        candidate = 4 * static_cast<uint32_t>(next.face) + (static_cast<uint32_t>(next.side) + 1) % 4;
      }
      corner = candidate;
    }
  }
  return loops;
}

struct Spread {
  double min = 0.0;
  double median = 0.0;
  double max = 0.0;
};

Spread SpreadOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  return {*min, *middle, *max};
}

}  // namespace

absl::StatusOr<size_t> OrientFaces(QuadMesh& mesh) {
  TESSERA_ASSIGN_OR_RETURN(const auto across, UndirectedAdjacency(mesh));
  // 0 unseen, 1 as the component's first face, 2 turned over.
  std::vector<uint8_t> state(mesh.quads.size(), 0);
  std::vector<uint32_t> component;
  size_t turned = 0;
  for (uint32_t root = 0; root < mesh.quads.size(); ++root) {
    if (state[root] != 0) {
      continue;
    }
    state[root] = 1;
    component.assign(1, root);
    for (size_t i = 0; i < component.size(); ++i) {
      const uint32_t face = component[i];
      for (uint32_t side = 0; side < 4; ++side) {
        const uint32_t other = across[face][side];
        if (other == kNone) {
          continue;
        }
        const bool same_direction = SideVertices(mesh, 4 * face + side)[0] == SideVertices(mesh, other)[0];
        const uint8_t wanted = same_direction ? static_cast<uint8_t>(3 - state[face]) : state[face];
        if (state[other / 4] == 0) {
          state[other / 4] = wanted;
          component.push_back(other / 4);
        } else if (state[other / 4] != wanted) {
          const auto [a, b] = SideVertices(mesh, 4 * face + side);
          return absl::InvalidArgumentError(absl::StrCat("not orientable: faces ", face + 1, " and ",
                                                         other / 4 + 1, " cannot both be oriented along the ",
                                                         EdgeName(mesh.positions, a, b)));
        }
      }
    }
    const size_t against = static_cast<size_t>(
        std::count_if(component.begin(), component.end(), [&](uint32_t face) { return state[face] == 2; }));
    const uint8_t to_turn = 2 * against > component.size() ? 1 : 2;
    for (const uint32_t face : component) {
      if (state[face] == to_turn) {
        std::swap(mesh.quads[face][1], mesh.quads[face][3]);
        ++turned;
      }
    }
  }
  return turned;
}

size_t SplitSingularVertices(QuadMesh& mesh, const QuadAdjacency& adjacency) {
  uint32_t num_fans = 0;
  const std::vector<uint32_t> fan = FanOfCorner(adjacency, mesh.quads.size(), &num_fans);
  const size_t before = mesh.positions.size();
  std::vector<uint32_t> first_fan(before, kNone);
  std::vector<uint32_t> copy_of_fan(num_fans, kNone);
  for (uint32_t corner = 0; corner < fan.size(); ++corner) {
    uint32_t& vertex = mesh.quads[corner / 4][corner % 4];
    if (first_fan[vertex] == kNone) {
      first_fan[vertex] = fan[corner];
    }
    if (first_fan[vertex] == fan[corner]) {
      continue;
    }
    uint32_t& copy = copy_of_fan[fan[corner]];
    if (copy == kNone) {
      copy = static_cast<uint32_t>(mesh.positions.size());
      mesh.positions.push_back(Eigen::Vector3f(mesh.positions[vertex]));
      if (mesh.normals.size() == copy) {
        mesh.normals.push_back(Eigen::Vector3f(mesh.normals[vertex]));
      }
    }
    vertex = copy;
  }
  return mesh.positions.size() - before;
}

size_t DropUnreferencedVertices(QuadMesh& mesh) {
  std::vector<uint32_t> new_index(mesh.positions.size(), kNone);
  for (const Quad& quad : mesh.quads) {
    for (const uint32_t vertex : quad) {
      new_index[vertex] = 0;
    }
  }
  uint32_t kept = 0;
  for (size_t v = 0; v < new_index.size(); ++v) {
    if (new_index[v] == kNone) {
      continue;
    }
    new_index[v] = kept;
    mesh.positions[kept] = mesh.positions[v];
    if (v < mesh.normals.size()) {
      mesh.normals[kept] = mesh.normals[v];
    }
    ++kept;
  }
  for (Quad& quad : mesh.quads) {
    for (uint32_t& vertex : quad) {
      vertex = new_index[vertex];
    }
  }
  mesh.positions.resize(kept);
  mesh.normals.resize(std::min<size_t>(mesh.normals.size(), kept));
  return new_index.size() - kept;
}

MeshEdges ListEdges(const QuadAdjacency& adjacency) {
  MeshEdges edges;
  edges.edge_of.resize(adjacency.across.size());
  for (uint32_t face = 0; face < adjacency.across.size(); ++face) {
    for (uint32_t side = 0; side < 4; ++side) {
      const QuadAdjacency::Across& across = adjacency.across[face][side];
      if (across.face >= 0 && static_cast<uint32_t>(across.face) < face) {
        edges.edge_of[face][side] = edges.edge_of[across.face][across.side];
      } else {
        edges.edge_of[face][side] = static_cast<uint32_t>(edges.keys.size());
        edges.keys.push_back(4 * face + side);
      }
    }
  }
  return edges;
}

double QuadArea(const QuadMesh& mesh, size_t face) {
  const Quad& quad = mesh.quads[face];
  const Eigen::Vector3d p = (mesh.positions[quad[2]].cast<double>() - mesh.positions[quad[0]].cast<double>());
  const Eigen::Vector3d q = (mesh.positions[quad[3]].cast<double>() - mesh.positions[quad[1]].cast<double>());
  return 0.5 * p.cross(q).norm();
}

absl::StatusOr<MeshInfo> DescribeMesh(const QuadMesh& mesh) {
  TESSERA_RETURN_IF_ERROR(ValidateQuadMesh(mesh));
  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency adjacency, BuildAdjacency(mesh));
  const MeshEdges edges = ListEdges(adjacency);
  MeshInfo info;
  info.num_quads = mesh.quads.size();
  info.num_edges = edges.keys.size();
  info.num_components = CountComponents(adjacency);
  info.num_boundary_loops = CountBoundaryLoops(adjacency);

  uint32_t num_fans = 0;
  const std::vector<uint32_t> fan = FanOfCorner(adjacency, mesh.quads.size(), &num_fans);
  std::vector<uint32_t> valence(num_fans, 0);
  std::vector<bool> on_boundary(num_fans, false);
  std::vector<bool> referenced(mesh.positions.size(), false);
  for (uint32_t corner = 0; corner < fan.size(); ++corner) {
    ++valence[fan[corner]];
    referenced[mesh.quads[corner / 4][corner % 4]] = true;
    if (adjacency.across[corner / 4][corner % 4].face < 0) {
      ++info.num_boundary_edges;
      on_boundary[fan[corner]] = true;
    }
  }
  info.num_vertices = static_cast<size_t>(std::count(referenced.begin(), referenced.end(), true));
  for (uint32_t i = 0; i < num_fans; ++i) {
    info.num_irregular_vertices += !on_boundary[i] && valence[i] != 4;
  }
  // Every fan belongs to one component, so the sum of the components' formulas is the formula of the sums.
  const auto euler = static_cast<int64_t>(num_fans) - static_cast<int64_t>(info.num_edges) +
                     static_cast<int64_t>(info.num_quads);
  info.genus = static_cast<size_t>((2 * static_cast<int64_t>(info.num_components) -
                                    static_cast<int64_t>(info.num_boundary_loops) - euler) /
                                   2);

  std::vector<double> lengths;
  lengths.reserve(edges.keys.size());
  for (const uint32_t key : edges.keys) {
    const auto [a, b] = SideVertices(mesh, key);
    lengths.push_back((mesh.positions[a].cast<double>() - mesh.positions[b].cast<double>()).norm());
  }
  const Spread length = SpreadOf(std::move(lengths));
  info.min_edge = length.min;
  info.median_edge = length.median;
  info.max_edge = length.max;
  std::vector<double> areas(mesh.quads.size());
  for (size_t face = 0; face < areas.size(); ++face) {
    areas[face] = QuadArea(mesh, face);
  }
  const Spread area = SpreadOf(std::move(areas));
  info.min_area = area.min;
  info.median_area = area.median;
  info.max_area = area.max;
  info.box_min.setConstant(std::numeric_limits<float>::infinity());
  info.box_max.setConstant(-std::numeric_limits<float>::infinity());
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    if (referenced[v]) {
      info.box_min = info.box_min.cwiseMin(mesh.positions[v]);
      info.box_max = info.box_max.cwiseMax(mesh.positions[v]);
    }
  }
  return info;
}

}  // namespace tessera
