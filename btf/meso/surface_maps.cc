#include "btf/meso/surface_maps.h"

#include <algorithm>

namespace tessera {

void CentreOnReferencePlane(SurfaceMaps& maps) {
  if (maps.height.empty()) {
    return;
  }
  std::vector<float> sorted = maps.height;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const float median = *middle;
  for (float& z : maps.height) {
    z -= median;
  }
}

}  // namespace tessera
