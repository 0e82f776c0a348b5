// Which of many settings no other one beats in both of two costs.
#pragma once

#include <span>
#include <vector>

namespace tessera {

// Both the smaller the better.
struct TwoCosts {
  double x = 0.0;
  double y = 0.0;
};

// For each point whether it is on the front: no other is at most as costly in both and less in one. Points
// that are not finite are not on it and beat none.
[[nodiscard]] std::vector<bool> ParetoFront(std::span<const TwoCosts> points);

}  // namespace tessera
