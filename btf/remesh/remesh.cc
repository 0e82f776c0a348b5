#include "btf/remesh/remesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <Eigen/Geometry>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/remesh/closest_point.h"
#include "btf/remesh/creases.h"
#include "btf/remesh/quad_relaxer.h"
#include "btf/remesh/voxel_surface.h"

namespace tessera {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kCreaseAngleRad = 40.0 / kDegrees;
// Creases shorter than this many sides of a quad are left to the relaxation.
constexpr double kLeastCreaseSides = 4.0;
constexpr int kFreeSteps = 120;
constexpr double kSamplesPerQuad = 8.0;  // of the surface, that the quads are kept near to
// Vertices that no round of snapping could move yet may be moved after the steps of the one before.
constexpr int kSnapRounds = 3;
constexpr int kCreaseSteps = 20;
// Ways of drawing the voxels onto the surface, tried in this order until no quad is flipped.
constexpr std::array<int, 6> kAttachSteps{3, 2, 4, 1, 6, 10};
// Vertices of quads with a corner further than this from a right angle are repaired in the end.
constexpr double kRepairDeviationRad = 38.0 / kDegrees;
// Voxel grids are tried in rounds of these shares of a filled voxel, at sizes and places near the estimate.
constexpr std::array<double, 3> kCoverages{0.5, 0.35, 0.2};
constexpr int kSizesPerCoverage = 16;
constexpr double kSizeStep = 0.008;
constexpr size_t kMostCandidates = 8;
// Numbers of quads this close to the target are as good as each other.
constexpr double kQuadsSought = 0.06;
// Missed shares of the surface up to this are as good as none.
constexpr double kMissedSought = 0.002;
// Estimates of the voxel size are corrected by their number of quads so often.
constexpr int kCorrections = 4;

// The mesh moved and scaled so that its box has diagonal 1 and centre 0.
struct UnitMesh {
  std::vector<Eigen::Vector3d> positions;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double scale = 1.0;  // of the input's units
};

absl::StatusOr<UnitMesh> ToUnit(const TriangleMesh& mesh) {
  Eigen::Vector3d low = mesh.positions[mesh.triangles[0][0]].cast<double>();
  Eigen::Vector3d high = low;
  for (const Triangle& triangle : mesh.triangles) {
    for (const uint32_t v : triangle) {
      low = low.cwiseMin(mesh.positions[v].cast<double>());
      high = high.cwiseMax(mesh.positions[v].cast<double>());
    }
  }
  UnitMesh unit;
  unit.centre = 0.5 * (low + high);
  unit.scale = (high - low).norm();
  if (!((high - low).minCoeff() > 0.0)) {
    return absl::InvalidArgumentError("the mesh has no volume: its box is flat");
  }
  unit.positions.reserve(mesh.positions.size());
  for (const Eigen::Vector3f& p : mesh.positions) {
    unit.positions.push_back((p.cast<double>() - unit.centre) / unit.scale);
  }
  return unit;
}

// The side of voxels whose boundary has about `target` faces: each facet gives its area's shadows on the
// three planes of the axes.
double EstimateCell(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles,
                    double target) {
  double shadows = 0.0;
  for (const Triangle& triangle : triangles) {
    const Eigen::Vector3d& a = positions[triangle[0]];
    shadows += 0.5 * (positions[triangle[1]] - a).cross(positions[triangle[2]] - a).lpNorm<1>();
  }
  return std::sqrt(shadows / target);
}

// Share of the triangles whose first corner has no filled voxel at it or across a face of that: parts too
// thin for the grid.
double MissedShare(const VoxelGrid& grid, std::span<const Eigen::Vector3d> positions,
                   std::span<const Triangle> triangles) {
  const std::array<Eigen::Vector3i, 7> steps{Eigen::Vector3i(0, 0, 0),  Eigen::Vector3i(1, 0, 0),
                                             Eigen::Vector3i(-1, 0, 0), Eigen::Vector3i(0, 1, 0),
                                             Eigen::Vector3i(0, -1, 0), Eigen::Vector3i(0, 0, 1),
                                             Eigen::Vector3i(0, 0, -1)};
  const auto missed = std::count_if(triangles.begin(), triangles.end(), [&](const Triangle& triangle) {
    const Eigen::Vector3i at =
        ((positions[triangle[0]] - grid.origin) / grid.cell).array().floor().cast<int>();
    return std::none_of(steps.begin(), steps.end(), [&](const Eigen::Vector3i& step) {
      const Eigen::Vector3i voxel = at + step;
      return grid.filled[grid.Index(voxel.x(), voxel.y(), voxel.z())] != 0;
    });
  });
  return static_cast<double>(missed) / static_cast<double>(triangles.size());
}

// How far a voxel boundary is from what is wanted, the first element first.
struct Rank {
  double miss_of_target = 0.0;
  int64_t miss_of_components = 0;
  int64_t miss_of_genus = 0;
  double missed_share = 0.0;
  double irregular_share = 0.0;

  friend auto operator<=>(const Rank&, const Rank&) = default;
};

// Voxel boundaries to relax, the best first, at least one.
absl::StatusOr<std::vector<VoxelSurface>> VoxelCandidates(std::span<const Eigen::Vector3d> positions,
                                                          std::span<const Triangle> triangles,
                                                          const SurfaceTopology& topology, double target,
                                                          const RunContext& context) {
  std::vector<std::pair<Rank, VoxelSurface>> found;
  // Adds the boundary to `found` and returns its number of quads.
  const auto add = [&](const VoxelParams& params) -> absl::StatusOr<size_t> {
    TESSERA_ASSIGN_OR_RETURN(VoxelGrid grid, Voxelise(positions, triangles, params, context));
    MakeManifold(grid);
    VoxelSurface surface = BoundaryOf(grid, topology.num_components);
    const auto num_quads = static_cast<double>(surface.quads.size());
    if (surface.quads.empty()) {
      return 0;
    }
    const double miss = std::abs(num_quads / target - 1.0);
    const double missed = MissedShare(grid, positions, triangles);
    Rank rank{.miss_of_target = miss > kQuadsSought ? miss : 0.0,
              .miss_of_components = static_cast<int64_t>(topology.num_components) -
                                    static_cast<int64_t>(surface.topology.num_components),
              .miss_of_genus = std::abs(surface.topology.genus - topology.genus),
              .missed_share = missed > kMissedSought ? missed : 0.0,
              .irregular_share = static_cast<double>(surface.num_irregular_vertices) / num_quads};
    const auto place = std::upper_bound(found.begin(), found.end(), rank,
                                        [](const Rank& a, const auto& b) { return a < b.first; });
    found.insert(place, {rank, std::move(surface)});
    found.resize(std::min(found.size(), kMostCandidates));
    return static_cast<size_t>(num_quads);
  };
  double cell = EstimateCell(positions, triangles, target);
  for (size_t round = 0; round < kCoverages.size(); ++round) {
    for (int i = 0; i < kCorrections; ++i) {
      TESSERA_ASSIGN_OR_RETURN(const size_t num_quads,
                               add({.cell = cell, .least_coverage = kCoverages[round]}));
      cell *= num_quads == 0 ? 0.5 : std::sqrt(static_cast<double>(num_quads) / target);
    }
    for (int i = 0; i < kSizesPerCoverage; ++i) {
      context.Report("voxels", round * kSizesPerCoverage + static_cast<uint64_t>(i),
                     kCoverages.size() * kSizesPerCoverage, "grids");
      // Sizes on both sides of the estimate, places by multiples of irrational numbers.
      const double steps = (i % 2 == 0 ? 1 : -1) * ((i + 1) / 2);
      const Eigen::Vector3d offset(std::fmod(i * 0.6180339887, 1.0), std::fmod(i * 0.7548776662, 1.0),
                                   std::fmod(i * 0.5698402910, 1.0));
      TESSERA_RETURN_IF_ERROR(add({.cell = cell * (1.0 + steps * kSizeStep),
                                   .offset = offset,
                                   .least_coverage = kCoverages[round]})
                                  .status());
    }
    if (!found.empty()) {
      const Rank& best = found.front().first;
      if (best < Rank{.missed_share = std::numeric_limits<double>::min()}) {
        break;
      }
    }
  }
  if (found.empty()) {
    return absl::InvalidArgumentError("the mesh has no volume: no voxel is inside");
  }
  std::vector<VoxelSurface> candidates;
  for (auto& [rank, surface] : found) {
    candidates.push_back(std::move(surface));
  }
  return candidates;
}

// About `count` points, evenly over the area.
std::vector<SurfaceSample> SamplesOf(std::span<const Eigen::Vector3d> positions,
                                     std::span<const Triangle> triangles, const ClosestPoint& surface,
                                     double count) {
  const auto area_of = [&](const Triangle& t) {
    return 0.5 * (positions[t[1]] - positions[t[0]]).cross(positions[t[2]] - positions[t[0]]).norm();
  };
  double total = 0.0;
  for (const Triangle& triangle : triangles) {
    total += area_of(triangle);
  }
  std::vector<SurfaceSample> samples;
  double owed = 0.5;
  for (size_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    for (owed += area_of(t) / total * count; owed >= 1.0; owed -= 1.0) {
      // Places by multiples of irrational numbers, folded from the square into the triangle.
      const auto n = static_cast<double>(samples.size());
      double b = std::fmod(n * 0.7548776662, 1.0);
      double c = std::fmod(n * 0.5698402910, 1.0);
      if (b + c > 1.0) {
        b = 1.0 - b;
        c = 1.0 - c;
      }
      samples.push_back({(1.0 - b - c) * positions[t[0]] + b * positions[t[1]] + c * positions[t[2]],
                         surface.normals()[i]});
    }
  }
  return samples;
}

// The first of the candidates that can be drawn onto the surface without flipping a quad, or the one that
// flips the fewest.
absl::StatusOr<QuadRelaxer> AttachVoxels(const std::vector<VoxelSurface>& candidates,
                                         const ClosestPoint& surface, const RunContext& context,
                                         size_t& chosen) {
  std::optional<QuadRelaxer> best;
  size_t least_flipped = std::numeric_limits<size_t>::max();
  for (size_t i = 0; i < candidates.size() && least_flipped > 0; ++i) {
    for (size_t j = 0; j < kAttachSteps.size() && least_flipped > 0; ++j) {
      context.Report("attach", i * kAttachSteps.size() + j, candidates.size() * kAttachSteps.size(), "ways");
      QuadRelaxer attached(surface, candidates[i].positions, candidates[i].quads, context);
      TESSERA_RETURN_IF_ERROR(attached.Attach(kAttachSteps[j]));
      TESSERA_RETURN_IF_ERROR(attached.Repair(std::numbers::pi / 2.0));
      if (const size_t flipped = attached.CountFlipped(); flipped < least_flipped) {
        least_flipped = flipped;
        best.emplace(std::move(attached));
        chosen = i;
      }
    }
  }
  return *std::move(best);
}

// Largest and mean distance both ways between the input and the quads.
absl::Status MeasureDistance(std::span<const Eigen::Vector3d> positions, std::span<const Triangle> triangles,
                             const ClosestPoint& surface, const QuadRelaxer& relaxer,
                             std::span<const Quad> quads, const RunContext& context, RemeshReport& report) {
  TESSERA_ASSIGN_OR_RETURN(const ClosestPoint remeshed,
                           ClosestPoint::Create(relaxer.positions(), HalvesOf(quads)));
  std::vector<bool> used(positions.size(), false);
  for (const Triangle& triangle : triangles) {
    for (const uint32_t v : triangle) {
      used[v] = true;
    }
  }
  constexpr int64_t kPointsPerRange = 256;
  std::vector<double> distances(positions.size() + quads.size(), 0.0);
  ParallelFor(
      context, 0, static_cast<int64_t>(distances.size()), kPointsPerRange, [&](int64_t begin, int64_t end) {
        for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
          if (i >= positions.size()) {
            const Quad& quad = quads[i - positions.size()];
            const std::vector<Eigen::Vector3d>& p = relaxer.positions();
            distances[i] = surface.Find(0.25 * (p[quad[0]] + p[quad[1]] + p[quad[2]] + p[quad[3]])).distance;
          } else if (used[i]) {
            distances[i] = remeshed.Find(positions[i]).distance;
          }
        }
      });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  const auto num_used = std::count(used.begin(), used.end(), true) + static_cast<int64_t>(quads.size());
  for (const double distance : distances) {
    report.mean_distance += distance / static_cast<double>(num_used);
    report.worst_distance = std::max(report.worst_distance, distance);
  }
  return absl::OkStatus();
}

void MeasureShapes(const QuadRelaxer& relaxer, size_t num_quads, RemeshReport& report,
                   std::optional<size_t>& first_flipped) {
  double area = 0.0;
  for (size_t i = 0; i < num_quads; ++i) {
    area += relaxer.ShapeOf(i).area / static_cast<double>(num_quads);
  }
  const auto count = static_cast<double>(num_quads);
  for (size_t i = 0; i < num_quads; ++i) {
    const QuadShape shape = relaxer.ShapeOf(i);
    const double ratio = std::max(shape.area / area, area / shape.area);
    report.mean_area_ratio += ratio / count;
    report.worst_area_ratio = std::max(report.worst_area_ratio, ratio);
    for (const double angle : shape.angles_rad) {
      const double deviation = std::abs(angle * kDegrees - 90.0);
      report.mean_angle_deviation_deg += deviation / (4.0 * count);
      report.worst_angle_deviation_deg = std::max(report.worst_angle_deviation_deg, deviation);
    }
    report.num_flipped += shape.flipped;
    if (shape.flipped && !first_flipped) {
      first_flipped = i;
    }
  }
}

}  // namespace

std::vector<std::string> RemeshReport::Warnings() const {
  std::vector<std::string> warnings;
  if (topology_out != topology_in) {
    warnings.push_back(absl::StrFormat(
        "%d components of genus %d became %d of genus %d; more quads keep thinner parts and holes",
        topology_in.num_components, topology_in.genus, topology_out.num_components, topology_out.genus));
  }
  if (std::abs(static_cast<double>(num_quads) / static_cast<double>(target_quads) - 1.0) > kQuadsTolerance) {
    warnings.push_back(absl::StrFormat("%d quads instead of about %d", num_quads, target_quads));
  }
  const auto limit = [&](double value, double most, std::string_view what) {
    if (value > most) {
      warnings.push_back(absl::StrFormat("%s is %.3g; beyond %g textures are visibly distorted",
                                         std::string(what), value, most));
    }
  };
  limit(mean_angle_deviation_deg, kMaxMeanAngleDeviationDeg, "the mean deviation of corners from 90 degrees");
  limit(worst_angle_deviation_deg, kMaxWorstAngleDeviationDeg,
        "the worst deviation of corners from 90 degrees");
  limit(worst_area_ratio, kMaxWorstAreaRatio, "the worst ratio of a quad's area and the mean");
  if (worst_distance > kMaxSurfaceDistance) {
    warnings.push_back(
        absl::StrFormat("the quads miss the surface by up to %.3g of the diagonal of its box, the limit is "
                        "%g; more quads keep thinner parts",
                        worst_distance, kMaxSurfaceDistance));
  }
  return warnings;
}

absl::StatusOr<RemeshResult> RemeshTriangles(const TriangleMesh& mesh, const RemeshParams& params,
                                             const RunContext& context) {
  if (params.target_quads < kMinRemeshQuads || params.target_quads > kMaxRemeshQuads) {
    return absl::InvalidArgumentError(absl::StrCat("a target of ", params.target_quads, " quads, expected ",
                                                   kMinRemeshQuads, " to ", kMaxRemeshQuads));
  }
  RemeshResult result;
  RemeshReport& report = result.report;
  TESSERA_ASSIGN_OR_RETURN(report.topology_in, CheckClosedSurface(mesh));
  TESSERA_ASSIGN_OR_RETURN(const UnitMesh unit, ToUnit(mesh));
  report.target_quads = params.target_quads;
  TESSERA_ASSIGN_OR_RETURN(
      const std::vector<VoxelSurface> candidates,
      VoxelCandidates(unit.positions, mesh.triangles, report.topology_in, params.target_quads, context));
  TESSERA_ASSIGN_OR_RETURN(const ClosestPoint surface, ClosestPoint::Create(unit.positions, mesh.triangles));
  size_t chosen = 0;
  TESSERA_ASSIGN_OR_RETURN(QuadRelaxer relaxer, AttachVoxels(candidates, surface, context, chosen));
  const VoxelSurface& voxels = candidates[chosen];
  report.topology_out = voxels.topology;
  report.num_quads = voxels.quads.size();
  relaxer.Cover(SamplesOf(unit.positions, mesh.triangles, surface,
                          kSamplesPerQuad * static_cast<double>(report.num_quads)));
  TESSERA_RETURN_IF_ERROR(relaxer.Relax("relax", kFreeSteps));
  const double side = EstimateCell(unit.positions, mesh.triangles, params.target_quads);
  TESSERA_ASSIGN_OR_RETURN(const Creases creases, FindCreases(unit.positions, mesh.triangles, surface,
                                                              kCreaseAngleRad, kLeastCreaseSides * side));
  for (int round = 0; round < kSnapRounds; ++round) {
    report.num_on_creases += relaxer.SnapToCreases(creases);
    TESSERA_RETURN_IF_ERROR(relaxer.Relax("relax on creases", kCreaseSteps));
  }
  TESSERA_RETURN_IF_ERROR(relaxer.Repair(kRepairDeviationRad));
  std::optional<size_t> first_flipped;
  MeasureShapes(relaxer, voxels.quads.size(), report, first_flipped);
  TESSERA_RETURN_IF_ERROR(
      MeasureDistance(unit.positions, mesh.triangles, surface, relaxer, voxels.quads, context, report));
  result.mesh.quads = voxels.quads;
  for (const Eigen::Vector3d& p : relaxer.positions()) {
    result.mesh.positions.push_back((unit.centre + unit.scale * p).cast<float>());
  }
  result.mesh.normals = ComputeNormals(result.mesh);
  // Rounded to float32, sides may lose their length far from the origin.
  TESSERA_RETURN_IF_ERROR(ValidateQuadMesh(result.mesh));
  if (first_flipped) {
    const Eigen::Vector3f& at = result.mesh.positions[result.mesh.quads[*first_flipped][0]];
    return absl::FailedPreconditionError(absl::StrFormat(
        "%d of %d quads stay flipped, the first at (%g, %g, %g); another number of quads may do",
        report.num_flipped, report.num_quads, at.x(), at.y(), at.z()));
  }
  return result;
}

}  // namespace tessera
