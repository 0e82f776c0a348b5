#include "btf/wang/subdivide.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "btf/wang/mesh_topology.h"

namespace tessera {
namespace {

// Roots of a union-find forest over edges, the lowest edge of a set being its root.
class DisjointSets {
 public:
  explicit DisjointSets(size_t size) : parent_(size) { std::iota(parent_.begin(), parent_.end(), 0u); }

  uint32_t Root(uint32_t i) {
    while (parent_[i] != i) {
      parent_[i] = parent_[parent_[i]];
      i = parent_[i];
    }
    return i;
  }
  void Join(uint32_t a, uint32_t b) {
    const uint32_t root_a = Root(a);
    const uint32_t root_b = Root(b);
    parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
  }

 private:
  std::vector<uint32_t> parent_;
};

double SideLength(const QuadMesh& mesh, size_t face, int side) {
  const Quad& quad = mesh.quads[face];
  return (mesh.positions[quad[side]].cast<double>() - mesh.positions[quad[(side + 1) & 3]].cast<double>())
      .norm();
}

double Median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// `length` to 8 significant bits, so that chords which differ by rounding alone are split alike and a
// symmetric mesh stays symmetric.
double Rounded(double length) {
  constexpr double kScale = 256.0;
  int exponent = 0;
  const double mantissa = std::frexp(length, &exponent);
  return std::ldexp(std::max(1.0, std::round(mantissa * kScale)) / kScale, exponent);
}

// The n that brings length / n nearest to `target` in ratio: the least n with length <= target sqrt(n (n +
// 1)).
uint32_t PartsFor(double length, double target) {
  constexpr double kMostParts = 65536.0;
  const double ratio = std::min(length / target, kMostParts);
  auto n = static_cast<uint32_t>(std::max(1.0, std::floor(ratio)));
  while (ratio > std::sqrt(static_cast<double>(n) * (n + 1))) {
    ++n;
  }
  return n;
}

std::vector<uint32_t> CountsFor(const std::vector<double>& lengths, double target) {
  std::vector<uint32_t> counts(lengths.size());
  std::transform(lengths.begin(), lengths.end(), counts.begin(),
                 [&](double length) { return PartsFor(length, target); });
  return counts;
}

// Counts nearest to `target` quads, at most `limit` if that can be. The number of quads falls as the length
// grows, so bisect; square roots and comparisons only, so every machine finds the same.
std::vector<uint32_t> CountsForQuads(const Chords& chords, const std::vector<double>& lengths,
                                     uint64_t target, uint64_t limit) {
  const auto [min, max] = std::minmax_element(lengths.begin(), lengths.end());
  double fine = *min / 4096.0;
  double coarse = *max * 2.0;
  constexpr int kBisections = 60;
  for (int i = 0; i < kBisections; ++i) {
    const double middle = std::sqrt(fine) * std::sqrt(coarse);
    (SubdividedQuads(chords, CountsFor(lengths, middle)) > target ? fine : coarse) = middle;
  }
  std::vector<uint32_t> above = CountsFor(lengths, fine);
  std::vector<uint32_t> below = CountsFor(lengths, coarse);
  const uint64_t quads_above = SubdividedQuads(chords, above);
  const uint64_t quads_below = SubdividedQuads(chords, below);
  const bool take_above = quads_above <= limit && quads_above > target && quads_below <= target &&
                          quads_above - target < target - quads_below;
  return take_above ? above : below;
}

}  // namespace

Chords FindChords(const QuadAdjacency& adjacency) {
  const MeshEdges edges = ListEdges(adjacency);
  DisjointSets sets(edges.keys.size());
  for (const std::array<uint32_t, 4>& sides : edges.edge_of) {
    sets.Join(sides[0], sides[2]);
    sets.Join(sides[1], sides[3]);
  }
  constexpr uint32_t kUnnumbered = std::numeric_limits<uint32_t>::max();
  std::vector<uint32_t> number(edges.keys.size(), kUnnumbered);
  Chords chords;
  chords.of_face.resize(edges.edge_of.size());
  for (size_t face = 0; face < edges.edge_of.size(); ++face) {
    for (int side = 0; side < 2; ++side) {
      uint32_t& chord = number[sets.Root(edges.edge_of[face][side])];
      if (chord == kUnnumbered) {
        chord = chords.num_chords++;
      }
      chords.of_face[face][side] = chord;
    }
  }
  return chords;
}

uint64_t SubdividedQuads(const Chords& chords, const std::vector<uint32_t>& counts) {
  uint64_t quads = 0;
  for (const auto& [a, b] : chords.of_face) {
    quads += uint64_t{counts[a]} * counts[b];
  }
  return quads;
}

std::vector<uint32_t> ChordCounts(const QuadMesh& mesh, const Chords& chords, uint32_t target_quads) {
  std::vector<std::vector<double>> of_chord(chords.num_chords);
  std::vector<double> all;
  all.reserve(mesh.quads.size() * 4);
  for (size_t face = 0; face < mesh.quads.size(); ++face) {
    for (int side = 0; side < 4; ++side) {
      all.push_back(SideLength(mesh, face, side));
      of_chord[chords.across(face, side)].push_back(all.back());
    }
  }
  std::vector<double> lengths(chords.num_chords);
  std::transform(of_chord.begin(), of_chord.end(), lengths.begin(),
                 [](std::vector<double>& edges) { return Rounded(Median(edges)); });

  const uint64_t limit = kMaxMeshQuads;
  if (target_quads != 0) {
    return CountsForQuads(chords, lengths, std::min<uint64_t>(target_quads, limit), limit);
  }
  const uint64_t quads = mesh.quads.size();
  std::vector<uint32_t> counts = CountsFor(lengths, Rounded(Median(all)));
  const uint64_t result = SubdividedQuads(chords, counts);
  if (result < kDefaultTargetQuads) {
    return CountsForQuads(chords, lengths, kDefaultTargetQuads, limit);
  }
  const uint64_t most =
      std::min<uint64_t>(kMaxDefaultGrowth * std::max<uint64_t>(quads, kDefaultTargetQuads), limit);
  return result > most ? CountsForQuads(chords, lengths, most, most) : counts;
}

QuadMesh SubdivideQuads(const QuadMesh& mesh, const QuadAdjacency& adjacency, const Chords& chords,
                        const std::vector<uint32_t>& counts) {
  const MeshEdges edges = ListEdges(adjacency);
  QuadMesh fine;
  fine.positions = mesh.positions;
  fine.normals = mesh.normals;
  fine.quads.reserve(SubdividedQuads(chords, counts));

  const auto add_vertex = [&](const Eigen::Vector3d& position, const Eigen::Vector3d& normal,
                              const Eigen::Vector3f& fallback) {
    const double length = normal.norm();
    constexpr double kLeastLength = 1e-6;  // of a blend of unit vectors; below it they point apart
    fine.positions.push_back(position.cast<float>());
    fine.normals.push_back(length > kLeastLength ? Eigen::Vector3f((normal / length).cast<float>())
                                                 : fallback);
    return static_cast<uint32_t>(fine.positions.size() - 1);
  };

  // The vertices inside each edge, in the direction of the side that is its key.
  std::vector<uint32_t> first_on_edge(edges.keys.size());
  for (size_t edge = 0; edge < edges.keys.size(); ++edge) {
    const uint32_t face = edges.keys[edge] / 4;
    const int side = static_cast<int>(edges.keys[edge] % 4);
    const uint32_t a = mesh.quads[face][side];
    const uint32_t b = mesh.quads[face][(side + 1) & 3];
    const uint32_t n = counts[chords.across(face, side)];
    first_on_edge[edge] = static_cast<uint32_t>(fine.positions.size());
    for (uint32_t i = 1; i < n; ++i) {
      const double s = static_cast<double>(i) / n;
      add_vertex((1.0 - s) * mesh.positions[a].cast<double>() + s * mesh.positions[b].cast<double>(),
                 (1.0 - s) * mesh.normals[a].cast<double>() + s * mesh.normals[b].cast<double>(),
                 mesh.normals[a]);
    }
  }

  std::vector<uint32_t> grid;
  for (uint32_t face = 0; face < mesh.quads.size(); ++face) {
    const Quad& quad = mesh.quads[face];
    const uint32_t columns = counts[chords.across(face, 0)];
    const uint32_t rows = counts[chords.across(face, 1)];
    // Vertex i of the way along a side, i in 0..n.
    const auto on_side = [&](int side, uint32_t i, uint32_t n) {
      if (i == 0 || i == n) {
        return quad[(side + (i == 0 ? 0 : 1)) & 3];
      }
      const uint32_t edge = edges.edge_of[face][side];
      const bool along = edges.keys[edge] == 4 * face + static_cast<uint32_t>(side);
      return first_on_edge[edge] + (along ? i : n - i) - 1;
    };
    grid.assign(static_cast<size_t>(columns + 1) * (rows + 1), 0);
    for (uint32_t j = 0; j <= rows; ++j) {
      for (uint32_t i = 0; i <= columns; ++i) {
        uint32_t& vertex = grid[j * (columns + 1) + i];
        if (j == 0) {
          vertex = on_side(0, i, columns);
        } else if (j == rows) {
          vertex = on_side(2, columns - i, columns);
        } else if (i == 0) {
          vertex = on_side(3, rows - j, rows);
        } else if (i == columns) {
          vertex = on_side(1, j, rows);
        } else {
          const double s = static_cast<double>(i) / columns;
          const double t = static_cast<double>(j) / rows;
          const std::array<double, 4> weights{(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t};
          Eigen::Vector3d position = Eigen::Vector3d::Zero();
          Eigen::Vector3d normal = Eigen::Vector3d::Zero();
          for (int k = 0; k < 4; ++k) {
            position += weights[k] * mesh.positions[quad[k]].cast<double>();
            normal += weights[k] * mesh.normals[quad[k]].cast<double>();
          }
          vertex = add_vertex(position, normal, mesh.normals[quad[0]]);
        }
      }
    }
    for (uint32_t j = 0; j < rows; ++j) {
      for (uint32_t i = 0; i < columns; ++i) {
        const uint32_t corner = j * (columns + 1) + i;
        fine.quads.push_back(
            {grid[corner], grid[corner + 1], grid[corner + columns + 2], grid[corner + columns + 1]});
      }
    }
  }
  return fine;
}

}  // namespace tessera
