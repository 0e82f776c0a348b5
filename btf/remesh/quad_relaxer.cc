#include "btf/remesh/quad_relaxer.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include <Eigen/Geometry>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr int64_t kItemsPerRange = 256;
// How far the side of the square that a quad asks for is from its own to the mesh's mean: less evens sizes
// slowly, more puts sizes before angles.
constexpr double kSizeShare = 0.3;
// A vertex is snapped to a crease from within this many sides.
constexpr double kSnapSides = 0.6;
// And to the corner of creases from within this many; corners are few and their vertices further off.
constexpr double kCornerSides = 1.2;
// Snapping keeps corners within this of a right angle, unless they were worse.
constexpr double kSnapDeviationRad = 60.0 * std::numbers::pi / 180.0;
constexpr int kStepsPerMiss = 2;  // what the mesh misses is found anew every other step
constexpr int kRepairSweeps = 30;
constexpr std::array<double, 4> kRepairSteps{0.4, 0.2, 0.08, 0.03};  // in sides
constexpr int kRepairDirections = 8;

// Adds the corners, counter-clockwise about `normal`, of the square nearest to a quad.
std::array<Eigen::Vector3d, 4> NearestSquare(const std::array<Eigen::Vector3d, 4>& p, double mean_side) {
  const Eigen::Vector3d centre = 0.25 * (p[0] + p[1] + p[2] + p[3]);
  const Eigen::Vector3d normal = (p[2] - p[0]).cross(p[3] - p[1]);
  const double length = normal.norm();
  if (!(length > 0.0)) {
    return {centre, centre, centre, centre};
  }
  const Eigen::Vector3d n = normal / length;
  // Least squares: the mean of the corners, each turned back to the first one's place.
  const Eigen::Vector3d d = 0.25 * (p[0] - p[2] + (p[1] - p[3]).cross(n));
  Eigen::Vector3d radius = d - d.dot(n) * n;
  const double own = radius.norm();
  if (own > 0.0) {
    const double wanted = mean_side * std::numbers::sqrt2 / 2.0;
    radius *= 1.0 - kSizeShare + kSizeShare * wanted / own;
  }
  const Eigen::Vector3d turned = n.cross(radius);
  return {centre + radius, centre + turned, centre - radius, centre - turned};
}

}  // namespace

QuadRelaxer::QuadRelaxer(const ClosestPoint& surface, std::vector<Eigen::Vector3d> positions,
                         std::span<const Quad> quads, const RunContext& context)
    : surface_(surface),
      positions_(std::move(positions)),
      quads_(quads),
      context_(context),
      first_corner_(positions_.size() + 1, 0),
      corners_(4 * quads.size()),
      at_(positions_.size(), 0),
      hold_(positions_.size(), Hold::kSurface) {
  for (const Quad& quad : quads_) {
    for (const uint32_t v : quad) {
      ++first_corner_[v + 1];
    }
  }
  std::partial_sum(first_corner_.begin(), first_corner_.end(), first_corner_.begin());
  std::vector<uint32_t> next(first_corner_.begin(), first_corner_.end() - 1);
  for (uint32_t corner = 0; corner < corners_.size(); ++corner) {
    corners_[next[quads_[corner / 4][corner % 4]]++] = corner;
  }
  mean_side_ = MeanSide();
}

double QuadRelaxer::MeanSide() const {
  double area = 0.0;
  for (const Quad& quad : quads_) {
    area +=
        0.5 *
        (positions_[quad[2]] - positions_[quad[0]]).cross(positions_[quad[3]] - positions_[quad[1]]).norm();
  }
  return std::sqrt(area / static_cast<double>(quads_.size()));
}

Eigen::Vector3d QuadRelaxer::MeshNormal(size_t vertex) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const uint32_t corner : CornersAt(vertex)) {
    const Quad& quad = quads_[corner / 4];
    sum += (positions_[quad[2]] - positions_[quad[0]]).cross(positions_[quad[3]] - positions_[quad[1]]);
  }
  return sum.normalized();
}

void QuadRelaxer::Place(size_t vertex, const SurfacePoint& at) {
  positions_[vertex] = at.position;
  at_[vertex] = at.triangle;
}

SurfacePoint QuadRelaxer::Allowed(size_t vertex, const Eigen::Vector3d& p) const {
  if (hold_[vertex] == Hold::kSurface) {
    return surface_.FindFacing(p, MeshNormal(vertex));
  }
  SurfacePoint at;
  at.triangle = at_[vertex];
  at.position = hold_[vertex] == Hold::kCorner ? positions_[vertex] : creases_->lines->Find(p).position;
  return at;
}

absl::Status QuadRelaxer::Attach(int num_steps) {
  std::vector<SurfacePoint> places(positions_.size());
  for (int step = 1; step <= num_steps; ++step) {
    const double share = static_cast<double>(step) / num_steps;
    ParallelFor(context_, 0, static_cast<int64_t>(places.size()), kItemsPerRange,
                [&](int64_t begin, int64_t end) {
                  for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v) {
                    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
                    for (const uint32_t corner : CornersAt(v)) {
                      const Quad& quad = quads_[corner / 4];
                      sum += positions_[quad[(corner + 1) & 3]] + positions_[quad[(corner + 3) & 3]];
                    }
                    const Eigen::Vector3d smooth = 0.5 * sum / static_cast<double>(CornersAt(v).size());
                    places[v] = surface_.FindFacing(smooth, MeshNormal(v));
                    places[v].position = smooth + share * (places[v].position - smooth);
                  }
                });
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    for (size_t v = 0; v < places.size(); ++v) {
      Place(v, places[v]);
    }
  }
  mean_side_ = MeanSide();
  return absl::OkStatus();
}

size_t QuadRelaxer::CountFlipped() const {
  size_t flipped = 0;
  for (size_t i = 0; i < quads_.size(); ++i) {
    flipped += ShapeOf(i).flipped;
  }
  return flipped;
}

absl::StatusOr<std::vector<Eigen::Vector3d>> QuadRelaxer::FindMisses() const {
  std::vector<Eigen::Vector3d> misses(positions_.size(), Eigen::Vector3d::Zero());
  if (samples_.empty()) {
    return misses;
  }
  const std::vector<Triangle> halves = HalvesOf(quads_);
  TESSERA_ASSIGN_OR_RETURN(const ClosestPoint mesh, ClosestPoint::Create(positions_, halves));
  std::vector<SurfacePoint> closest(samples_.size());
  ParallelFor(context_, 0, static_cast<int64_t>(samples_.size()), kItemsPerRange,
              [&](int64_t begin, int64_t end) {
                for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
                  closest[i] = mesh.FindFacing(samples_[i].position, samples_[i].normal);
                }
              });
  TESSERA_RETURN_IF_ERROR(context_.CheckStop());
  std::vector<double> weights(positions_.size(), 0.0);
  for (size_t i = 0; i < samples_.size(); ++i) {
    const Eigen::Vector3d miss = samples_[i].position - closest[i].position;
    for (int k = 0; k < 3; ++k) {
      const uint32_t v = halves[closest[i].triangle][k];
      const double weight = closest[i].barycentric[k] * miss.norm();
      misses[v] += weight * miss;
      weights[v] += weight;
    }
  }
  for (size_t v = 0; v < misses.size(); ++v) {
    if (weights[v] > 0.0) {
      misses[v] /= weights[v];
    }
  }
  return misses;
}

absl::Status QuadRelaxer::Relax(std::string_view stage, int num_steps) {
  std::vector<std::array<Eigen::Vector3d, 4>> squares(quads_.size());
  std::vector<Eigen::Vector3d> misses;
  std::vector<SurfacePoint> places(positions_.size());
  std::vector<SurfacePoint> before(positions_.size());
  std::vector<uint8_t> was_flipped(quads_.size());
  for (int step = 0; step < num_steps; ++step) {
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    context_.Report(stage, static_cast<uint64_t>(step), static_cast<uint64_t>(num_steps), "steps");
    if (step % kStepsPerMiss == 0) {
      TESSERA_ASSIGN_OR_RETURN(misses, FindMisses());
    }
    ParallelFor(context_, 0, static_cast<int64_t>(quads_.size()), kItemsPerRange,
                [&](int64_t begin, int64_t end) {
                  for (auto i = static_cast<size_t>(begin); i < static_cast<size_t>(end); ++i) {
                    const Quad& quad = quads_[i];
                    squares[i] = NearestSquare(
                        {positions_[quad[0]], positions_[quad[1]], positions_[quad[2]], positions_[quad[3]]},
                        mean_side_);
                    was_flipped[i] = ShapeOf(i).flipped;
                  }
                });
    ParallelFor(context_, 0, static_cast<int64_t>(positions_.size()), kItemsPerRange,
                [&](int64_t begin, int64_t end) {
                  for (auto v = static_cast<size_t>(begin); v < static_cast<size_t>(end); ++v) {
                    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
                    for (const uint32_t corner : CornersAt(v)) {
                      sum += squares[corner / 4][corner % 4];
                    }
                    places[v] = Allowed(v, sum / static_cast<double>(CornersAt(v).size()) + misses[v]);
                  }
                });
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    for (size_t v = 0; v < places.size(); ++v) {
      before[v].position = positions_[v];
      before[v].triangle = at_[v];
      Place(v, places[v]);
    }
    // Each round takes back moves that the one before left, so it ends.
    for (bool again = true; again;) {
      again = false;
      for (size_t i = 0; i < quads_.size(); ++i) {
        if (was_flipped[i] != 0 || !ShapeOf(i).flipped) {
          continue;
        }
        for (const uint32_t v : quads_[i]) {
          if (positions_[v] != before[v].position || at_[v] != before[v].triangle) {
            Place(v, before[v]);
            again = true;
          }
        }
      }
    }
    mean_side_ = MeanSide();
  }
  return absl::OkStatus();
}

QuadShape QuadRelaxer::ShapeOf(size_t quad) const {
  const Quad& v = quads_[quad];
  const std::array<Eigen::Vector3d, 4> p{positions_[v[0]], positions_[v[1]], positions_[v[2]],
                                         positions_[v[3]]};
  const Eigen::Vector3d area = 0.5 * (p[2] - p[0]).cross(p[3] - p[1]);
  QuadShape shape;
  shape.area = area.norm();
  Eigen::Vector3d outwards = Eigen::Vector3d::Zero();
  for (const uint32_t vertex : v) {
    outwards += SurfaceNormal(vertex);
  }
  shape.flipped = !(area.dot(outwards) > 0.0);
  // Corners are seen along the surface's normal where the quad itself faces away.
  const Eigen::Vector3d& axis = shape.flipped ? outwards : area;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d next = p[(k + 1) & 3] - p[k];
    const Eigen::Vector3d previous = p[(k + 3) & 3] - p[k];
    const Eigen::Vector3d cross = next.cross(previous);
    const double turn = cross.dot(axis);
    shape.flipped = shape.flipped || !(turn > 0.0);
    shape.angles_rad[k] = std::atan2(std::copysign(cross.norm(), turn), next.dot(previous));
  }
  return shape;
}

double QuadRelaxer::Energy(size_t vertex) const {
  double energy = 0.0;
  for (const uint32_t corner : CornersAt(vertex)) {
    const QuadShape shape = ShapeOf(corner / 4);
    for (const double angle : shape.angles_rad) {
      // In right angles: 1 is a flat or folded corner. The high power puts the worst corner first.
      const double d = std::abs(angle - std::numbers::pi / 2.0) / (std::numbers::pi / 2.0);
      energy += d * d + 8.0 * d * d * d * d * d * d;
    }
    const double size =
        std::log(std::max(shape.area, 1e-9 * mean_side_ * mean_side_) / (mean_side_ * mean_side_));
    energy += 0.15 * size * size + (shape.flipped ? 100.0 : 0.0);
  }
  return energy;
}

double QuadRelaxer::WorstDeviation(size_t vertex) const {
  double worst = 0.0;
  for (const uint32_t corner : CornersAt(vertex)) {
    const QuadShape shape = ShapeOf(corner / 4);
    for (const double angle : shape.angles_rad) {
      worst = std::max(worst, std::abs(angle - std::numbers::pi / 2.0));
    }
    if (shape.flipped) {
      return std::numbers::pi;
    }
  }
  return worst;
}

size_t QuadRelaxer::SnapToCreases(const Creases& creases) {
  if (!creases.lines) {
    return 0;
  }
  creases_ = &creases;
  size_t snapped = 0;
  const auto try_to = [&](size_t vertex, const Eigen::Vector3d& place, Hold hold) {
    const Eigen::Vector3d before = positions_[vertex];
    const double allowed = std::max(kSnapDeviationRad, WorstDeviation(vertex));
    positions_[vertex] = place;
    if (WorstDeviation(vertex) > allowed) {
      positions_[vertex] = before;
      return false;
    }
    snapped += hold_[vertex] == Hold::kSurface;
    hold_[vertex] = hold;
    return true;
  };
  // Corners take the closest vertex that can be moved there.
  for (const Eigen::Vector3d& corner : creases.corners) {
    std::vector<std::pair<double, uint32_t>> near;
    for (uint32_t v = 0; v < positions_.size(); ++v) {
      if (const double distance = (positions_[v] - corner).norm(); distance < kCornerSides * mean_side_) {
        near.push_back({hold_[v] == Hold::kCorner ? 0.0 : distance, v});
      }
    }
    std::sort(near.begin(), near.end());
    for (const auto& [distance, v] : near) {
      if (hold_[v] == Hold::kCorner || try_to(v, corner, Hold::kCorner)) {
        break;
      }
    }
  }
  // Closest vertices first: they need to move the least.
  std::vector<std::pair<double, uint32_t>> order;
  std::vector<Eigen::Vector3d> place(positions_.size());
  for (uint32_t v = 0; v < positions_.size(); ++v) {
    const SurfacePoint at = creases.lines->Find(positions_[v]);
    place[v] = at.position;
    if (hold_[v] == Hold::kSurface && at.distance < kSnapSides * mean_side_) {
      order.push_back({at.distance, v});
    }
  }
  std::sort(order.begin(), order.end());
  for (const auto& [distance, v] : order) {
    try_to(v, place[v], Hold::kCrease);
  }
  return snapped;
}

absl::Status QuadRelaxer::Repair(double least_deviation_rad) {
  for (int sweep = 0; sweep < kRepairSweeps; ++sweep) {
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    context_.Report("repair", static_cast<uint64_t>(sweep), kRepairSweeps, "sweeps");
    bool moved = false;
    for (size_t v = 0; v < positions_.size(); ++v) {
      if (hold_[v] == Hold::kCorner || WorstDeviation(v) <= least_deviation_rad) {
        continue;
      }
      SurfacePoint best;
      best.position = positions_[v];
      best.triangle = at_[v];
      double least = Energy(v);
      const SurfacePoint start = best;
      Eigen::Vector3d t = SurfaceNormal(v).unitOrthogonal();
      const Eigen::Vector3d b = SurfaceNormal(v).cross(t);
      for (const double step : kRepairSteps) {
        for (int direction = 0; direction < kRepairDirections; ++direction) {
          const double phi = 2.0 * std::numbers::pi * direction / kRepairDirections;
          const Eigen::Vector3d p =
              start.position + step * mean_side_ * (std::cos(phi) * t + std::sin(phi) * b);
          Place(v, Allowed(v, p));
          if (const double energy = Energy(v); energy < least) {
            least = energy;
            best.position = positions_[v];
            best.triangle = at_[v];
            moved = true;
          }
          Place(v, start);
        }
      }
      Place(v, best);
    }
    if (!moved) {
      break;
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
