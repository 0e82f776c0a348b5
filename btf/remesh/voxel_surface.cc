#include "btf/remesh/voxel_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr int kEmptyLayers = 2;
constexpr int kScanlinesPerSide = 2;
constexpr size_t kTrianglesPerStopCheck = size_t{1} << 16;

// A scanline meets a triangle.
struct Crossing {
  int64_t column = 0;
  double z = 0.0;
  int leaves = 0;  // +1 out of the inside, going up; -1 into it

  friend auto operator<=>(const Crossing&, const Crossing&) = default;
};

// How often the triangle's outline in the xy plane winds about (x, y): 0, or 1 with the sign of its sense. An
// edge that begins at or below y and ends above it counts where the point is left of it; directed by y alone,
// so both triangles of an edge decide alike.
int WindingAbout(const std::array<const Eigen::Vector3d*, 3>& corners, double x, double y) {
  int winding = 0;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d& a = *corners[k];
    const Eigen::Vector3d& b = *corners[(k + 1) % 3];
    const bool a_below = a.y() <= y;
    if (a_below == (b.y() <= y)) {
      continue;
    }
    const Eigen::Vector3d& low = a_below ? a : b;
    const Eigen::Vector3d& high = a_below ? b : a;
    const double left = (high.x() - low.x()) * (y - low.y()) - (high.y() - low.y()) * (x - low.x());
    if (left > 0.0) {
      winding += a_below ? 1 : -1;
    }
  }
  return winding;
}

// Height of the triangle's plane over (x, y), within the triangle's own heights.
double HeightAt(const std::array<const Eigen::Vector3d*, 3>& corners, double x, double y) {
  const Eigen::Vector3d& a = *corners[0];
  const Eigen::Vector3d u = *corners[1] - a;
  const Eigen::Vector3d v = *corners[2] - a;
  const double determinant = u.x() * v.y() - u.y() * v.x();
  const auto [low, high] = std::minmax({a.z(), corners[1]->z(), corners[2]->z()});
  if (determinant == 0.0) {
    return low;
  }
  const double s = ((x - a.x()) * v.y() - (y - a.y()) * v.x()) / determinant;
  const double t = ((y - a.y()) * u.x() - (x - a.x()) * u.y()) / determinant;
  return std::clamp(a.z() + s * u.z() + t * v.z(), low, high);
}

// Adds the stretch [from, to] of a scanline to the shares of a column, heights in voxels.
void Cover(std::span<float> column, double from, double to) {
  constexpr double kShare = 1.0 / (kScanlinesPerSide * kScanlinesPerSide);
  const int last = static_cast<int>(column.size()) - 1;
  for (int z = std::clamp(static_cast<int>(std::floor(from)), 0, last); z <= last && z < to; ++z) {
    const double length = std::min<double>(to, z + 1) - std::max<double>(from, z);
    column[static_cast<size_t>(z)] += static_cast<float>(kShare * std::max(0.0, length));
  }
}

// The eight voxels about a corner of the grid as bits, voxel (i, j, k) of the block at bit 4 i + 2 j + k.
constexpr int BlockBit(int i, int j, int k) {
  return 1 << (4 * i + 2 * j + k);
}

// Whether the voxels of `mask` hang together by faces.
bool IsConnected(int mask) {
  int reached = mask & -mask;
  for (int before = 0; before != reached;) {
    before = reached;
    for (int bit = 0; bit < 8; ++bit) {
      if ((reached >> bit & 1) != 0) {
        for (const int axis : {1, 2, 4}) {
          reached |= mask & (1 << (bit ^ axis));
        }
      }
    }
  }
  return reached == mask;
}

// Whether two filled voxels face each other across an edge, with two empty ones beside them.
bool HasCrossedEdge(int mask) {
  for (const int axis : {1, 2, 4}) {
    const int s = axis == 1 ? 2 : 1;
    const int t = 7 ^ axis ^ s;
    for (const int level : {0, axis}) {
      const auto filled = [&](int bit) { return (mask >> bit & 1) != 0; };
      const bool here = filled(level);
      if (here == filled(level | s | t) && filled(level | s) != here && filled(level | t) != here) {
        return true;
      }
    }
  }
  return false;
}

std::array<bool, 256> ManifoldMasks() {
  std::array<bool, 256> manifold{};
  for (int mask = 0; mask < 256; ++mask) {
    manifold[mask] = IsConnected(mask) && IsConnected(255 & ~mask) && !HasCrossedEdge(mask);
  }
  return manifold;
}

uint32_t RootOf(std::vector<uint32_t>& parent, uint32_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

}  // namespace

absl::StatusOr<VoxelGrid> Voxelise(std::span<const Eigen::Vector3d> positions,
                                   std::span<const Triangle> triangles, const VoxelParams& params,
                                   const RunContext& context) {
  Eigen::Vector3d low = positions[triangles[0][0]];
  Eigen::Vector3d high = low;
  for (const Triangle& triangle : triangles) {
    for (const uint32_t v : triangle) {
      low = low.cwiseMin(positions[v]);
      high = high.cwiseMax(positions[v]);
    }
  }
  VoxelGrid grid;
  grid.cell = params.cell;
  grid.least_coverage = params.least_coverage;
  const Eigen::Vector3d cells = ((high - low) / params.cell + params.offset).array().ceil();
  const Eigen::Vector3d sizes = cells.array() + 2.0 * kEmptyLayers;
  if (!(sizes.prod() <= static_cast<double>(kMaxVoxels))) {
    return absl::ResourceExhaustedError(absl::StrCat("the box of the mesh takes ", sizes.prod(),
                                                     " voxels at this number of quads; the limit is ",
                                                     kMaxVoxels));
  }
  grid.size = sizes.cast<int>();
  grid.origin = low - params.cell * (params.offset.array() + kEmptyLayers).matrix();
  const size_t num_voxels = static_cast<size_t>(grid.size.x()) * grid.size.y() * grid.size.z();
  grid.coverage.assign(num_voxels, 0.0f);

  // Crossings, with coordinates in voxels; scanlines stand at the centres of the quarters of a column.
  const int lines_x = grid.size.x() * kScanlinesPerSide;
  const int lines_y = grid.size.y() * kScanlinesPerSide;
  const auto centre = [](int line) { return (line + 0.5) / kScanlinesPerSide; };
  const auto first_line = [](double least, int lines) {
    return std::clamp(static_cast<int>(std::floor(least * kScanlinesPerSide - 0.5)), 0, lines - 1);
  };
  const auto in_voxels = [&](uint32_t v) -> Eigen::Vector3d {
    return (positions[v] - grid.origin) / grid.cell;
  };
  std::vector<Crossing> crossings;
  for (size_t i = 0; i < triangles.size(); ++i) {
    if (i % kTrianglesPerStopCheck == 0) {
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
    }
    const std::array<Eigen::Vector3d, 3> p{in_voxels(triangles[i][0]), in_voxels(triangles[i][1]),
                                           in_voxels(triangles[i][2])};
    const std::array<const Eigen::Vector3d*, 3> corners{&p[0], &p[1], &p[2]};
    const auto [low_x, high_x] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
    const auto [low_y, high_y] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
    for (int x = first_line(low_x, lines_x); x < lines_x && centre(x) <= high_x; ++x) {
      for (int y = first_line(low_y, lines_y); y < lines_y && centre(y) <= high_y; ++y) {
        if (const int winding = WindingAbout(corners, centre(x), centre(y)); winding != 0) {
          crossings.push_back({int64_t{x} * lines_y + y, HeightAt(corners, centre(x), centre(y)), winding});
        }
      }
    }
  }
  std::sort(crossings.begin(), crossings.end());
  int winding = 0;
  for (size_t i = 0; i + 1 < crossings.size(); ++i) {
    winding -= crossings[i].leaves;
    if (winding > 0) {
      const auto x = static_cast<int>(crossings[i].column / lines_y / kScanlinesPerSide);
      const auto y = static_cast<int>(crossings[i].column % lines_y / kScanlinesPerSide);
      Cover(std::span(grid.coverage).subspan(grid.Index(x, y, 0), static_cast<size_t>(grid.size.z())),
            crossings[i].z, crossings[i + 1].z);
    }
  }
  grid.filled.resize(num_voxels);
  std::transform(grid.coverage.begin(), grid.coverage.end(), grid.filled.begin(),
                 [&](float share) { return share >= grid.least_coverage; });
  return grid;
}

size_t MakeManifold(VoxelGrid& grid) {
  static const std::array<bool, 256> kManifold = ManifoldMasks();
  std::vector<bool> touched(grid.filled.size(), false);
  std::array<size_t, 8> step{};
  for (int bit = 0; bit < 8; ++bit) {
    step[bit] = grid.Index(bit >> 2, bit >> 1 & 1, bit & 1);
  }
  size_t changed = 0;
  for (bool again = true; again;) {
    again = false;
    for (int x = 0; x + 1 < grid.size.x(); ++x) {
      for (int y = 0; y + 1 < grid.size.y(); ++y) {
        for (int z = 0; z + 1 < grid.size.z(); ++z) {
          const size_t base = grid.Index(x, y, z);
          int mask = 0;
          for (int bit = 0; bit < 8; ++bit) {
            mask |= grid.filled[base + step[bit]] << bit;
          }
          if (kManifold[mask]) {
            continue;
          }
          // Changes that make this corner a manifold come first, then those of voxels not yet changed, then
          // small ones.
          std::tuple<int, int, double, int> best{2, 2, 0.0, -1};
          for (int bit = 0; bit < 8; ++bit) {
            const size_t voxel = base + step[bit];
            if (touched[voxel] && grid.filled[voxel] != 0) {
              continue;
            }
            best = std::min(best, {kManifold[mask ^ (1 << bit)] ? 0 : 1, touched[voxel] ? 1 : 0,
                                   std::abs(grid.coverage[voxel] - grid.least_coverage), bit});
          }
          if (const int bit = std::get<3>(best); bit >= 0) {
            const size_t voxel = base + step[bit];
            grid.filled[voxel] ^= 1;
            touched[voxel] = true;
            ++changed;
            again = true;
          }
        }
      }
    }
  }
  return changed;
}

VoxelSurface BoundaryOf(const VoxelGrid& grid, size_t most_components) {
  // Faces with their corners named by place.
  using Place = uint64_t;
  const auto place = [&](const Eigen::Vector3i& at) {
    return (static_cast<Place>(at.x()) * (grid.size.y() + 1) + at.y()) * (grid.size.z() + 1) + at.z();
  };
  const auto filled = [&](const Eigen::Vector3i& at) {
    return (at.array() >= 0).all() && (at.array() < grid.size.array()).all() &&
           grid.filled[grid.Index(at.x(), at.y(), at.z())] != 0;
  };
  std::vector<std::array<Place, 4>> faces;
  for (int x = 0; x < grid.size.x(); ++x) {
    for (int y = 0; y < grid.size.y(); ++y) {
      for (int z = 0; z < grid.size.z(); ++z) {
        const Eigen::Vector3i at(x, y, z);
        for (int axis = 0; filled(at) && axis < 3; ++axis) {
          const Eigen::Vector3i n = Eigen::Vector3i::Unit(axis);
          const Eigen::Vector3i s = Eigen::Vector3i::Unit((axis + 1) % 3);
          const Eigen::Vector3i t = Eigen::Vector3i::Unit((axis + 2) % 3);
          if (!filled(at + n)) {
            const Eigen::Vector3i c = at + n;
            faces.push_back({place(c), place(c + s), place(c + s + t), place(c + t)});
          }
          if (!filled(at - n)) {
            faces.push_back({place(at), place(at + t), place(at + s + t), place(at + s)});
          }
        }
      }
    }
  }
  std::vector<Place> places;
  places.reserve(4 * faces.size());
  for (const auto& face : faces) {
    places.insert(places.end(), face.begin(), face.end());
  }
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  std::vector<Quad> quads(faces.size());
  std::vector<uint32_t> parent(places.size());
  std::iota(parent.begin(), parent.end(), 0u);
  for (size_t i = 0; i < faces.size(); ++i) {
    for (int k = 0; k < 4; ++k) {
      quads[i][k] =
          static_cast<uint32_t>(std::lower_bound(places.begin(), places.end(), faces[i][k]) - places.begin());
      parent[RootOf(parent, quads[i][k])] = RootOf(parent, quads[i][0]);
    }
  }
  // Components by size, at a tie by their first quad.
  std::vector<uint32_t> quads_of(places.size(), 0);
  std::vector<uint32_t> roots;
  for (const Quad& quad : quads) {
    const uint32_t root = RootOf(parent, quad[0]);
    if (quads_of[root]++ == 0) {
      roots.push_back(root);
    }
  }
  std::stable_sort(roots.begin(), roots.end(),
                   [&](uint32_t a, uint32_t b) { return quads_of[a] > quads_of[b]; });
  for (size_t i = most_components; i < roots.size(); ++i) {
    quads_of[roots[i]] = 0;
  }

  VoxelSurface surface;
  surface.topology.num_components = std::min(most_components, roots.size());
  std::vector<uint32_t> new_index(places.size());
  for (uint32_t v = 0; v < places.size(); ++v) {
    if (quads_of[RootOf(parent, v)] == 0) {
      continue;
    }
    new_index[v] = static_cast<uint32_t>(surface.positions.size());
    const auto columns = static_cast<Place>(grid.size.z() + 1);
    const auto rows = static_cast<Place>(grid.size.y() + 1);
    const Eigen::Vector3d at(static_cast<double>(places[v] / columns / rows),
                             static_cast<double>(places[v] / columns % rows),
                             static_cast<double>(places[v] % columns));
    surface.positions.push_back(grid.origin + grid.cell * at);
  }
  std::vector<uint8_t> valence(surface.positions.size(), 0);
  for (Quad quad : quads) {
    if (quads_of[RootOf(parent, quad[0])] == 0) {
      continue;
    }
    for (uint32_t& v : quad) {
      v = new_index[v];
      ++valence[v];
    }
    surface.quads.push_back(quad);
  }
  surface.num_irregular_vertices =
      static_cast<size_t>(std::count_if(valence.begin(), valence.end(), [](uint8_t n) { return n != 4; }));
  // Euler: V - E + F = 2 components - 2 genus, with E = 2 F.
  const int64_t euler =
      static_cast<int64_t>(surface.positions.size()) - static_cast<int64_t>(surface.quads.size());
  surface.topology.genus = static_cast<int64_t>(surface.topology.num_components) - euler / 2;
  return surface;
}

}  // namespace tessera
