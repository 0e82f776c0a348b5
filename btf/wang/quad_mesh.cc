#include "btf/wang/quad_mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <Eigen/Geometry>

#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/wang/half_edges.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little, "meshes are hashed as they lie in memory");
static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(Quad) == 16);

// File normals are rounded to a few digits; further off than this they are not meant as unit vectors.
constexpr double kUnitTolerance = 1e-3;

absl::Status CheckSizes(const QuadMesh& mesh) {
  if (mesh.quads.empty()) {
    return absl::InvalidArgumentError("the mesh has no faces");
  }
  if (mesh.positions.size() > kMaxMeshVertices || mesh.quads.size() > kMaxMeshQuads) {
    return absl::ResourceExhaustedError(absl::StrCat("the mesh has ", mesh.positions.size(), " vertices and ",
                                                     mesh.quads.size(), " quads; the limits are ",
                                                     kMaxMeshVertices, " and ", kMaxMeshQuads));
  }
  if (mesh.normals.size() != mesh.positions.size()) {
    return absl::InvalidArgumentError(absl::StrCat("the mesh has ", mesh.normals.size(), " normals for ",
                                                   mesh.positions.size(), " vertices"));
  }
  return absl::OkStatus();
}

absl::Status CheckFace(const QuadMesh& mesh, size_t face) {
  const Quad& quad = mesh.quads[face];
  for (int k = 0; k < 4; ++k) {
    if (quad[k] >= mesh.positions.size()) {
      return absl::InvalidArgumentError(absl::StrCat("face ", face + 1, ": vertex ", uint64_t{quad[k]} + 1,
                                                     " does not exist; the mesh has ",
                                                     mesh.positions.size()));
    }
    for (int j = 0; j < k; ++j) {
      if (quad[j] == quad[k]) {
        return absl::InvalidArgumentError(
            absl::StrCat("face ", face + 1, ": vertex ", uint64_t{quad[k]} + 1, " occurs twice"));
      }
    }
  }
  for (int k = 0; k < 4; ++k) {
    if (mesh.positions[quad[k]] == mesh.positions[quad[(k + 1) & 3]]) {
      return absl::InvalidArgumentError(absl::StrCat("face ", face + 1, ": side ", k + 1, " has no length: ",
                                                     EdgeName(mesh.positions, quad[k], quad[(k + 1) & 3])));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateQuadMesh(const QuadMesh& mesh) {
  TESSERA_RETURN_IF_ERROR(CheckSizes(mesh));
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    if (!mesh.positions[v].allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat("vertex ", v + 1, ": the position is not finite"));
    }
    // Written so that NaN fails, too.
    if (!(std::abs(mesh.normals[v].cast<double>().norm() - 1.0) < kUnitTolerance)) {
      return absl::InvalidArgumentError(absl::StrCat("vertex ", v + 1, ": the normal has length ",
                                                     mesh.normals[v].cast<double>().norm(), ", expected 1"));
    }
  }
  for (size_t face = 0; face < mesh.quads.size(); ++face) {
    TESSERA_RETURN_IF_ERROR(CheckFace(mesh, face));
  }
  return absl::OkStatus();
}

std::string EdgeName(std::span<const Eigen::Vector3f> positions, uint32_t vertex_a, uint32_t vertex_b) {
  const Eigen::Vector3f& a = positions[vertex_a];
  const Eigen::Vector3f& b = positions[vertex_b];
  return absl::StrFormat("edge between vertices %d at (%g, %g, %g) and %d at (%g, %g, %g)",
                         uint64_t{vertex_a} + 1, a.x(), a.y(), a.z(), uint64_t{vertex_b} + 1, b.x(), b.y(),
                         b.z());
}

std::vector<HalfEdge> SortedHalfEdges(const QuadMesh& mesh) {
  const auto edge_of = [&](uint32_t face, uint32_t side) {
    const auto [low, high] = std::minmax(mesh.quads[face][side], mesh.quads[face][(side + 1) & 3]);
    return HalfEdge{low, high, 4 * face + side};
  };
  const auto visit = [&](const auto& visitor) {
    for (uint32_t face = 0; face < mesh.quads.size(); ++face) {
      for (uint32_t side = 0; side < 4; ++side) {
        visitor(edge_of(face, side));
      }
    }
  };
  // By the lower vertex through counts, then the few edges of each.
  std::vector<uint32_t> ends(mesh.positions.size() + 1, 0);
  visit([&](const HalfEdge& edge) { ++ends[edge.low + 1]; });
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<HalfEdge> half_edges(mesh.quads.size() * 4);
  visit([&](const HalfEdge& edge) { half_edges[ends[edge.low]++] = edge; });
  uint32_t begin = 0;
  for (size_t vertex = 0; vertex < mesh.positions.size(); ++vertex) {
    std::sort(half_edges.begin() + begin, half_edges.begin() + ends[vertex]);
    begin = ends[vertex];
  }
  return half_edges;
}

absl::Status CheckEdgesManifold(const QuadMesh& mesh, std::span<const HalfEdge> half_edges) {
  for (size_t i = 0; i + 2 < half_edges.size(); ++i) {
    const HalfEdge& edge = half_edges[i];
    if (!edge.SameEdge(half_edges[i + 2])) {
      continue;
    }
    std::string faces;
    size_t count = 0;
    for (; i + count < half_edges.size() && half_edges[i + count].SameEdge(edge); ++count) {
      absl::StrAppend(&faces, count == 0 ? "" : ", ", half_edges[i + count].side / 4 + 1);
    }
    return absl::InvalidArgumentError(
        absl::StrCat("not a manifold: the ", EdgeName(mesh.positions, edge.low, edge.high), " is shared by ",
                     count, " faces (", faces, "); at most 2 may meet at an edge"));
  }
  return absl::OkStatus();
}

absl::StatusOr<QuadAdjacency> BuildAdjacency(const QuadMesh& mesh) {
  const std::vector<HalfEdge> half_edges = SortedHalfEdges(mesh);
  TESSERA_RETURN_IF_ERROR(CheckEdgesManifold(mesh, half_edges));
  QuadAdjacency adjacency;
  adjacency.across.resize(mesh.quads.size());
  for (size_t i = 0; i + 1 < half_edges.size(); ++i) {
    if (!half_edges[i].SameEdge(half_edges[i + 1])) {
      continue;
    }
    const uint32_t face_a = half_edges[i].side / 4;
    const uint32_t face_b = half_edges[i + 1].side / 4;
    const uint32_t side_a = half_edges[i].side % 4;
    const uint32_t side_b = half_edges[i + 1].side % 4;
    if (mesh.quads[face_a][side_a] == mesh.quads[face_b][side_b]) {
      return absl::InvalidArgumentError(absl::StrCat(
          "not oriented: faces ", face_a + 1, " and ", face_b + 1, " run in the same direction along the ",
          EdgeName(mesh.positions, half_edges[i].low, half_edges[i].high)));
    }
    adjacency.across[face_a][side_a] = {static_cast<int>(face_b), static_cast<int>(side_b)};
    adjacency.across[face_b][side_b] = {static_cast<int>(face_a), static_cast<int>(side_a)};
  }
  return adjacency;
}

Eigen::Vector3d WeightedCornerNormal(const QuadMesh& mesh, size_t face, int corner) {
  const Quad& quad = mesh.quads[face];
  const Eigen::Vector3d here = mesh.positions[quad[corner]].cast<double>();
  const Eigen::Vector3d next = mesh.positions[quad[(corner + 1) & 3]].cast<double>() - here;
  const Eigen::Vector3d previous = mesh.positions[quad[(corner + 3) & 3]].cast<double>() - here;
  const double weight = next.squaredNorm() * previous.squaredNorm();
  return weight > 0.0 ? Eigen::Vector3d(next.cross(previous) / weight) : Eigen::Vector3d(0.0, 0.0, 0.0);
}

std::vector<Eigen::Vector3f> ComputeNormals(const QuadMesh& mesh) {
  std::vector<Eigen::Vector3d> sums(mesh.positions.size(), Eigen::Vector3d::Zero());
  std::vector<double> lengths(mesh.positions.size(), 0.0);
  for (size_t face = 0; face < mesh.quads.size(); ++face) {
    for (int corner = 0; corner < 4; ++corner) {
      const Eigen::Vector3d normal = WeightedCornerNormal(mesh, face, corner);
      sums[mesh.quads[face][corner]] += normal;
      lengths[mesh.quads[face][corner]] += normal.norm();
    }
  }
  // Faces folded onto each other cancel down to rounding noise, which is no direction.
  constexpr double kLeastShare = 1e-9;
  std::vector<Eigen::Vector3f> normals(sums.size());
  for (size_t v = 0; v < sums.size(); ++v) {
    const double length = sums[v].norm();
    normals[v] = length > kLeastShare * lengths[v] ? Eigen::Vector3f((sums[v] / length).cast<float>())
                                                   : Eigen::Vector3f(0.0f, 0.0f, 1.0f);
  }
  return normals;
}

std::string QuadMeshSha256(const QuadMesh& mesh) {
  Sha256 hash;
  const std::array<uint32_t, 2> counts{static_cast<uint32_t>(mesh.positions.size()),
                                       static_cast<uint32_t>(mesh.quads.size())};
  hash.Update(std::as_bytes(std::span(counts)));
  hash.Update(std::as_bytes(std::span(mesh.positions)));
  hash.Update(std::as_bytes(std::span(mesh.normals)));
  hash.Update(std::as_bytes(std::span(mesh.quads)));
  return hash.HexDigest();
}

}  // namespace tessera
