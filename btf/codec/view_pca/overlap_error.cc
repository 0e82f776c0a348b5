#include "btf/codec/view_pca/overlap_error.h"

#include <algorithm>

namespace tessera {

double OverlapError(const Embedding& embedding, int num_components, std::span<const OverlapPixel> overlap) {
  const int c = std::clamp(num_components, 0, embedding.dims);
  double sum = 0.0;
  for (const auto& [first, second] : overlap) {
    const float* const p = embedding.at(first.turn, first.x, first.y);
    const float* const q = embedding.at(second.turn, second.x, second.y);
    for (int i = 0; i < c; ++i) {
      const double difference = static_cast<double>(p[i]) - static_cast<double>(q[i]);
      sum += difference * difference;
    }
  }
  return overlap.empty() ? 0.0 : sum / static_cast<double>(overlap.size());
}

double OverlapErrorThreshold(const Embedding& embedding, int num_components, double sensitivity) {
  const int c = std::clamp(num_components, 0, embedding.dims);
  double variance = 0.0;
  for (int i = 0; i < c; ++i) {
    variance += embedding.variance[i];
  }
  return sensitivity * sensitivity * 2.0 * variance;
}

}  // namespace tessera
