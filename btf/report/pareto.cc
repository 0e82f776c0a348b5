#include "btf/report/pareto.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace tessera {

std::vector<bool> ParetoFront(std::span<const TwoCosts> points) {
  std::vector<size_t> order(points.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::erase_if(order, [&](size_t i) { return !std::isfinite(points[i].x) || !std::isfinite(points[i].y); });
  std::ranges::sort(order, [&](size_t a, size_t b) {
    return points[a].x != points[b].x ? points[a].x < points[b].x : points[a].y < points[b].y;
  });
  std::vector<bool> front(points.size(), false);
  double least_before = std::numeric_limits<double>::infinity();  // y of what has a smaller x
  for (size_t i = 0; i < order.size();) {
    // Of those with one x the least in y, all that share it.
    const TwoCosts best = points[order[i]];
    size_t next = i;
    for (; next < order.size() && points[order[next]].x == best.x; ++next) {
      front[order[next]] = points[order[next]].y == best.y && best.y < least_before;
    }
    least_before = std::min(least_before, best.y);
    i = next;
  }
  return front;
}

}  // namespace tessera
