#include "btf/math/hemisphere_triangulation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace tessera {
namespace {

// Points closer than this are one, and points as near to a line lie on it. Directions come from files with
// degrees of few digits or as float32.
constexpr double kSamePoint = 1e-6;
// Triangles of less than this, twice their area, count as their edges: rounding would rule inside.
constexpr double kFlat = 1e-8;
// Points are moved to a grid this fine, in which orientation and circles are decided without rounding.
constexpr double kGrid = 0x1p-24;

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Twice the signed area of (a, b, c), positive counter-clockwise.
double Area(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return Cross(b - a, c - a);
}

Eigen::Vector2d ChartPoint(const Direction& direction) {
  return StereographicPoint(VectorFromDirection(direction));
}

// In steps of kGrid: at most 2^25 in differences, so that areas fit 64 bits and circles 128.
using GridPoint = Eigen::Matrix<int64_t, 2, 1>;

int64_t GridCross(const GridPoint& a, const GridPoint& b) {
  return a.x() * b.y() - a.y() * b.x();
}

int64_t GridArea(const GridPoint& a, const GridPoint& b, const GridPoint& c) {
  return GridCross(b - a, c - a);
}

// Whether d lies inside the circle through a, b, c (counter-clockwise).
bool IsInCircle(const GridPoint& a, const GridPoint& b, const GridPoint& c, const GridPoint& d) {
  const GridPoint p = a - d;
  const GridPoint q = b - d;
  const GridPoint r = c - d;
  const __int128 determinant = static_cast<__int128>(p.squaredNorm()) * GridCross(q, r) -
                               static_cast<__int128>(q.squaredNorm()) * GridCross(p, r) +
                               static_cast<__int128>(r.squaredNorm()) * GridCross(p, q);
  return determinant > 0;
}

// Any triangulation of points in the order of x, then y, that do not all lie on one line: each point is
// joined to the hull's edges that face it.
class Sweep {
 public:
  Sweep(const std::vector<GridPoint>& points, const std::vector<int>& order) : points_(points) {
    // The leading points on one line, and the first one off it.
    size_t line = 2;
    while (GridArea(points[order[0]], points[order[1]], points[order[line]]) == 0) {
      ++line;
    }
    const int apex = order[line];
    const bool is_left = GridArea(points[order[0]], points[order[1]], points[apex]) > 0;
    for (size_t i = 0; i + 1 < line; ++i) {
      const int a = order[is_left ? i : i + 1];
      const int b = order[is_left ? i + 1 : i];
      triangles_.push_back({a, b, apex});
    }
    hull_.assign(order.begin(), order.begin() + static_cast<ptrdiff_t>(line));
    if (!is_left) {
      std::ranges::reverse(hull_);
    }
    hull_.push_back(apex);
    for (size_t i = line + 1; i < order.size(); ++i) {
      Join(order[i]);
    }
  }

  std::vector<DirectionTriangle> Take() { return std::move(triangles_); }

 private:
  void Join(int point) {
    const size_t n = hull_.size();
    std::vector<bool> is_visible(n);
    for (size_t i = 0; i < n; ++i) {
      is_visible[i] = GridArea(points_[hull_[i]], points_[hull_[(i + 1) % n]], points_[point]) < 0;
    }
    // The visible edges are one run; its inner vertices leave the hull.
    size_t first = 0;
    while (!is_visible[first] || is_visible[(first + n - 1) % n]) {
      ++first;
    }
    std::vector<int> hull = {point};
    size_t i = first;
    for (; is_visible[i % n]; ++i) {
      triangles_.push_back({hull_[(i + 1) % n], hull_[i % n], point});
    }
    for (; i <= first + n; ++i) {
      hull.push_back(hull_[i % n]);
    }
    hull_ = std::move(hull);
  }

  const std::vector<GridPoint>& points_;
  std::vector<int> hull_;  // counter-clockwise
  std::vector<DirectionTriangle> triangles_;
};

// Lawson's flips: edges whose opposite corner lies in the circle are turned until none is left. Each flip
// lowers the lifted surface (x, y, x^2 + y^2), so it ends.
void MakeDelaunay(const std::vector<GridPoint>& points, std::vector<DirectionTriangle>& triangles) {
  using Edge = std::pair<int, int>;
  std::map<Edge, int> owner;  // of the directed edge
  std::vector<Edge> pending;
  for (size_t t = 0; t < triangles.size(); ++t) {
    for (int s = 0; s < 3; ++s) {
      const Edge edge{triangles[t][s], triangles[t][(s + 1) % 3]};
      owner[edge] = static_cast<int>(t);
      pending.push_back(edge);
    }
  }
  const auto opposite = [&](int t, const Edge& edge) {
    return *std::ranges::find_if(triangles[t],
                                 [&](int corner) { return corner != edge.first && corner != edge.second; });
  };
  while (!pending.empty()) {
    const Edge edge = pending.back();
    pending.pop_back();
    const auto left = owner.find(edge);
    const auto right = owner.find({edge.second, edge.first});
    if (left == owner.end() || right == owner.end()) {
      continue;
    }
    const int l = left->second;
    const int r = right->second;
    const auto [a, b] = edge;
    const int c = opposite(l, edge);
    const int d = opposite(r, edge);
    if (!IsInCircle(points[a], points[b], points[c], points[d])) {
      continue;
    }
    // The four are then convex: d sees the edge through the circle.
    owner.erase(left);
    owner.erase(right);
    triangles[l] = {c, d, b};
    triangles[r] = {d, c, a};
    for (const int t : {l, r}) {
      for (int s = 0; s < 3; ++s) {
        const Edge changed{triangles[t][s], triangles[t][(s + 1) % 3]};
        owner[changed] = t;
        pending.push_back(changed);
      }
    }
  }
}

struct Nearest {
  double squared_distance = std::numeric_limits<double>::infinity();
  BarycentricWeights weights;
};

void NearestInTriangle(const HemisphereInterpolator::Triangle& triangle, const Eigen::Vector2d& p,
                       Nearest& nearest) {
  const auto& [a, b, c] = triangle.corner;
  if (triangle.inverse_area > 0.0) {
    const double wa = Area(b, c, p) * triangle.inverse_area;
    const double wb = Area(c, a, p) * triangle.inverse_area;
    const double wc = 1.0 - wa - wb;
    if (wa >= 0.0 && wb >= 0.0 && wc >= 0.0) {
      nearest = {0.0, {triangle.index, {wa, wb, wc}}};
      return;
    }
  }
  for (int s = 0; s < 3; ++s) {
    const int next = (s + 1) % 3;
    const Eigen::Vector2d from = triangle.corner[s];
    const Eigen::Vector2d edge = triangle.corner[next] - from;
    const double length = edge.squaredNorm();
    const double t = length > 0.0 ? std::clamp(edge.dot(p - from) / length, 0.0, 1.0) : 0.0;
    const double squared_distance = (from + t * edge - p).squaredNorm();
    if (squared_distance < nearest.squared_distance) {
      nearest = {squared_distance, {triangle.index, {}}};
      nearest.weights.weight[s] = 1.0 - t;
      nearest.weights.weight[next] = t;
    }
  }
}

double Distance(const HemisphereInterpolator::Triangle& triangle, const Eigen::Vector2d& p) {
  Nearest nearest;
  NearestInTriangle(triangle, p, nearest);
  return std::sqrt(nearest.squared_distance);
}

}  // namespace

std::vector<DirectionTriangle> TriangulateHemisphere(std::span<const Direction> directions) {
  assert(!directions.empty());
  std::vector<Eigen::Vector2d> points;
  std::vector<GridPoint> grid;
  std::vector<int> order;
  for (size_t i = 0; i < directions.size(); ++i) {
    points.push_back(ChartPoint(directions[i]));
    grid.emplace_back(std::llround(points[i].x() / kGrid), std::llround(points[i].y() / kGrid));
    const bool is_new = std::ranges::none_of(
        order, [&](int other) { return (points[other] - points[i]).norm() < kSamePoint; });
    if (is_new) {
      order.push_back(static_cast<int>(i));
    }
  }
  if (order.size() == 1) {
    return {{order[0], order[0], order[0]}};
  }
  // All on one line, through the first point and the farthest from it?
  const auto from_first = [&](int i) -> Eigen::Vector2d { return points[i] - points[order[0]]; };
  const int farthest =
      *std::ranges::max_element(order, {}, [&](int i) { return from_first(i).squaredNorm(); });
  const Eigen::Vector2d along = from_first(farthest).normalized();
  std::vector<DirectionTriangle> triangles;
  if (std::ranges::all_of(order, [&](int i) { return std::abs(Cross(along, from_first(i))) < kSamePoint; })) {
    std::ranges::sort(order, {}, [&](int i) { return along.dot(from_first(i)); });
    for (size_t i = 0; i + 1 < order.size(); ++i) {
      triangles.push_back({order[i], order[i + 1], order[i + 1]});
    }
    return triangles;
  }
  std::ranges::sort(order, {}, [&](int i) { return std::pair(grid[i].x(), grid[i].y()); });
  triangles = Sweep(grid, order).Take();
  MakeDelaunay(grid, triangles);
  return triangles;
}

HemisphereInterpolator::HemisphereInterpolator(std::span<const Direction> directions,
                                               std::span<const DirectionTriangle> triangles) {
  assert(!directions.empty() && !triangles.empty());
  double limit = 0.0;
  for (const Direction& direction : directions) {
    limit = std::max(limit, std::min(direction.theta_rad, kPi / 2.0));
  }
  cos_limit_ = std::cos(limit);
  sin_limit_ = std::sin(limit);
  for (const DirectionTriangle& index : triangles) {
    Triangle triangle{.index = index};
    for (int s = 0; s < 3; ++s) {
      triangle.corner[s] = ChartPoint(directions[index[s]]);
    }
    const double area = Area(triangle.corner[0], triangle.corner[1], triangle.corner[2]);
    triangle.inverse_area = area > kFlat ? 1.0 / area : 0.0;
    triangles_.push_back(triangle);
  }
  FillCells();
}

void HemisphereInterpolator::FillCells() {
  constexpr double kCell = 2.0 / kCellsPerSide;
  // Reaches every point of a cell from its centre, also one that a float calculation puts into it.
  const double reach = 0.5 * std::sqrt(2.0) * kCell + 1e-5;
  struct Disc {
    Eigen::Vector2d centre;
    double radius = 0.0;
  };
  std::vector<Disc> discs;  // around the triangles
  for (const Triangle& triangle : triangles_) {
    Disc disc{(triangle.corner[0] + triangle.corner[1] + triangle.corner[2]) / 3.0};
    for (const Eigen::Vector2d& corner : triangle.corner) {
      disc.radius = std::max(disc.radius, (corner - disc.centre).norm());
    }
    discs.push_back(disc);
  }
  cell_begin_.push_back(0);
  std::vector<double> distances(triangles_.size());
  for (int cell = 0; cell < kCellsPerSide * kCellsPerSide; ++cell) {
    const Eigen::Vector2d centre(-1.0 + kCell * (cell % kCellsPerSide + 0.5),
                                 -1.0 + kCell * (cell / kCellsPerSide + 0.5));
    // A triangle nearest to some point of the cell is, at the centre, at most 2 reach beyond the nearest one.
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t t = 0; t < triangles_.size(); ++t) {
      const double at_least = (centre - discs[t].centre).norm() - discs[t].radius;
      distances[t] = at_least > nearest + 2.0 * reach ? at_least : Distance(triangles_[t], centre);
      nearest = std::min(nearest, distances[t]);
    }
    for (size_t t = 0; t < triangles_.size(); ++t) {
      if (distances[t] <= nearest + 2.0 * reach) {
        cell_triangles_.push_back(static_cast<int>(t));
      }
    }
    cell_begin_.push_back(static_cast<int>(cell_triangles_.size()));
  }
}

BarycentricWeights HemisphereInterpolator::Locate(const Eigen::Vector3d& direction) const {
  Eigen::Vector3d clamped = direction;
  if (direction.z() < cos_limit_) {
    // Not the pole: z is below a cosine, so x and y are not both 0.
    clamped.head<2>() *= sin_limit_ / direction.head<2>().norm();
    clamped.z() = cos_limit_;
  }
  const Eigen::Vector2d p = StereographicPoint(clamped);
  const auto cell_of = [](double x) {
    return std::clamp(static_cast<int>((x + 1.0) * (kCellsPerSide / 2)), 0, kCellsPerSide - 1);
  };
  const int cell = cell_of(p.y()) * kCellsPerSide + cell_of(p.x());
  Nearest nearest;
  for (int i = cell_begin_[cell]; i < cell_begin_[cell + 1] && nearest.squared_distance > 0.0; ++i) {
    NearestInTriangle(triangles_[cell_triangles_[i]], p, nearest);
  }
  return nearest.weights;
}

}  // namespace tessera
