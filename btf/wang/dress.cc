#include "btf/wang/dress.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/wang/edge_signs.h"
#include "btf/wang/frame_field.h"
#include "btf/wang/mesh_topology.h"
#include "btf/wang/neighbour.h"
#include "btf/wang/subdivide.h"

namespace tessera {
namespace {

constexpr std::string_view kStage = "dressing";
constexpr uint64_t kNumSteps = 3;
// How many broken edges a message names, and how many a dressing's metadata lists.
constexpr size_t kBreaksInMessage = 3;
constexpr size_t kBreaksInMetadata = 10000;

// The sides that a face needs, in face order: colours by edge, signs by trail.
std::vector<TileSides> SidesByTrails(const QuadAdjacency& adjacency, const MeshEdges& edges, uint64_t seed,
                                     int num_colours) {
  const std::vector<std::array<Sign, 4>> signs = EulerSigns(adjacency, seed);
  std::vector<TileSides> sides(adjacency.across.size());
  for (size_t face = 0; face < sides.size(); ++face) {
    for (int k = 0; k < 4; ++k) {
      sides[face][k] = {EdgeColour(seed, edges.keys[edges.edge_of[face][k]], num_colours), signs[face][k]};
    }
  }
  return sides;
}

// Likewise, with the signs that a frame gives: tile sides south and east '+', north and west '-'.
std::vector<TileSides> SidesByFrame(const std::vector<uint8_t>& turns, const MeshEdges& edges, uint64_t seed,
                                    int num_colours) {
  std::vector<TileSides> sides(turns.size());
  for (size_t face = 0; face < sides.size(); ++face) {
    for (int k = 0; k < 4; ++k) {
      const int tile_side = (k - turns[face]) & 3;
      sides[face][k] = {EdgeColour(seed, edges.keys[edges.edge_of[face][k]], num_colours),
                        tile_side < 2 ? Sign::kPlus : Sign::kMinus};
    }
  }
  return sides;
}

nlohmann::json BreaksJson(const std::vector<Break>& breaks) {
  nlohmann::json list = nlohmann::json::array();
  for (size_t i = 0; i < std::min(breaks.size(), kBreaksInMetadata); ++i) {
    list.push_back({breaks[i].face, breaks[i].side, breaks[i].other_face, breaks[i].other_side});
  }
  return list;
}

nlohmann::json Metadata(const QuadMesh& source, const MeshInfo& info, const std::vector<Break>& breaks) {
  return {{"source_quads", source.quads.size()},
          {"quads", info.num_quads},
          {"components", info.num_components},
          {"genus", info.genus},
          {"boundary_loops", info.num_boundary_loops},
          {"irregular_vertices", info.num_irregular_vertices},
          {"edge_length", {{"min", info.min_edge}, {"median", info.median_edge}, {"max", info.max_edge}}},
          {"quad_area", {{"min", info.min_area}, {"median", info.median_area}, {"max", info.max_area}}},
          {"num_breaks", breaks.size()},
          {"breaks", BreaksJson(breaks)}};
}

std::string BreaksMessage(const QuadMesh& mesh, const Arrangement& arrangement,
                          const std::vector<Break>& breaks) {
  std::string message =
      absl::StrCat(arrangement.id, " needs one consistent frame; it breaks at ", breaks.size(), " edge",
                   breaks.size() == 1 ? "" : "s", " of the subdivided mesh: ");
  for (size_t i = 0; i < std::min(breaks.size(), kBreaksInMessage); ++i) {
    const Quad& quad = mesh.quads[breaks[i].face];
    absl::StrAppend(&message, i == 0 ? "" : "; ",
                    EdgeName(mesh.positions, quad[breaks[i].side], quad[(breaks[i].side + 1) & 3]),
                    " (faces ", breaks[i].face + 1, " and ", breaks[i].other_face + 1, ")");
  }
  return absl::StrCat(message, breaks.size() > kBreaksInMessage ? "; .." : "",
                      ". Allow breaks, or take a surface arrangement");
}

}  // namespace

absl::StatusOr<std::vector<Break>> FindBreaks(const Dressing& dressing, const Arrangement& arrangement) {
  if (dressing.tile.size() != dressing.mesh.quads.size()) {
    return absl::InvalidArgumentError(absl::StrCat("the dressing has ", dressing.tile.size(), " tiles for ",
                                                   dressing.mesh.quads.size(), " quads"));
  }
  for (size_t face = 0; face < dressing.tile.size(); ++face) {
    if (dressing.tile[face] >= arrangement.codes.size()) {
      return absl::InvalidArgumentError(absl::StrCat("quad ", face + 1, ": tile ", dressing.tile[face],
                                                     " does not exist; ", arrangement.id, " has ",
                                                     arrangement.codes.size()));
    }
  }
  TESSERA_ASSIGN_OR_RETURN(const auto neighbours, BuildTileNeighbours(dressing));
  std::vector<Break> breaks;
  for (uint32_t face = 0; face < neighbours.size(); ++face) {
    const TileSides sides = arrangement.SidesOf(dressing.tile[face]);
    for (int face_side = 0; face_side < 4; ++face_side) {
      const int side = (face_side - dressing.turns[face]) & 3;
      const TileNeighbour& other = neighbours[face][side];
      // Each edge once, from its lower face; one across which a face meets itself cannot exist.
      if (other.face < static_cast<int64_t>(face)) {
        continue;
      }
      const TileSides other_sides = arrangement.SidesOf(dressing.tile[other.face]);
      const bool same_pool = arrangement.turned_strips || other.turns == 0;
      if (!same_pool || !SidesMatch(sides[side], other_sides[other.side])) {
        breaks.push_back({face, static_cast<uint8_t>(face_side), static_cast<uint32_t>(other.face),
                          static_cast<uint8_t>((other.side + dressing.turns[other.face]) & 3)});
      }
    }
  }
  return breaks;
}

absl::StatusOr<DressResult> DressMesh(const QuadMesh& mesh, const Arrangement& arrangement,
                                      const DressParams& params, const RunContext& context) {
  if (params.target_quads > kMaxMeshQuads) {
    return absl::InvalidArgumentError(
        absl::StrCat("target of ", params.target_quads, " quads; the limit is ", kMaxMeshQuads));
  }
  TESSERA_RETURN_IF_ERROR(ValidateQuadMesh(mesh));
  context.Report(kStage, 0, kNumSteps, "steps");
  DressResult result;
  Dressing& dressing = result.dressing;
  {
    TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency adjacency, BuildAdjacency(mesh));
    const Chords chords = FindChords(adjacency);
    dressing.mesh = SubdivideQuads(mesh, adjacency, chords, ChordCounts(mesh, chords, params.target_quads));
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  context.Report(kStage, 1, kNumSteps, "steps");

  TESSERA_ASSIGN_OR_RETURN(const QuadAdjacency adjacency, BuildAdjacency(dressing.mesh));
  const MeshEdges edges = ListEdges(adjacency);
  const std::vector<TileSides> sides =
      arrangement.turned_strips
          ? SidesByTrails(adjacency, edges, params.seed, arrangement.num_colours)
          : SidesByFrame(ConsistentTurns(adjacency), edges, params.seed, arrangement.num_colours);
  dressing.tile.resize(sides.size());
  dressing.turns.resize(sides.size());
  for (size_t face = 0; face < sides.size(); ++face) {
    const Arrangement::Laid laid = arrangement.TileShowing(sides[face]);
    if (laid.tile < 0) {
      return absl::InternalError(absl::StrCat(arrangement.id, " has no tile of code ",
                                              TileCode(sides[face], arrangement.num_colours),
                                              " in any turn"));
    }
    dressing.tile[face] = static_cast<uint32_t>(laid.tile);
    dressing.turns[face] = static_cast<uint8_t>(laid.turns);
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  context.Report(kStage, 2, kNumSteps, "steps");

  dressing.arrangement_id = arrangement.id;
  dressing.arrangement_sha256 = arrangement.sha256;
  dressing.seed = params.seed;
  dressing.source_mesh_sha256 = QuadMeshSha256(mesh);
  TESSERA_ASSIGN_OR_RETURN(result.breaks, FindBreaks(dressing, arrangement));
  if (!result.breaks.empty() && !params.allow_breaks) {
    return absl::FailedPreconditionError(BreaksMessage(dressing.mesh, arrangement, result.breaks));
  }
  TESSERA_ASSIGN_OR_RETURN(const MeshInfo info, DescribeMesh(dressing.mesh));
  dressing.metadata = Metadata(mesh, info, result.breaks);
  context.Report(kStage, kNumSteps, kNumSteps, "steps");
  return result;
}

}  // namespace tessera
