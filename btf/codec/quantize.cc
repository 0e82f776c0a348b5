#include "btf/codec/quantize.h"

#include <algorithm>
#include <cassert>

namespace tessera {

Quantisation UniformQuantisation(std::span<const float> minima, std::span<const float> maxima) {
  assert(minima.size() == maxima.size());
  constexpr double kLargestCode = 255.0;
  Quantisation quantisation;
  for (size_t i = 0; i < minima.size(); ++i) {
    // Adding 0 turns -0 into 0: which of them was found first depends on the order of the search.
    quantisation.offset.push_back(minima[i] + 0.0F);
    quantisation.step.push_back(
        static_cast<float>((static_cast<double>(maxima[i]) - static_cast<double>(minima[i])) / kLargestCode));
  }
  return quantisation;
}

void Quantize(const Quantisation& quantisation, std::span<const float> values, std::span<uint8_t> codes) {
  const size_t k = quantisation.offset.size();
  assert(values.size() == codes.size() && values.size() % k == 0);
  std::vector<float> inverse(k);
  for (size_t i = 0; i < k; ++i) {
    inverse[i] = quantisation.step[i] > 0.0F ? 1.0F / quantisation.step[i] : 0.0F;
  }
  const float* const offset = quantisation.offset.data();
  for (size_t begin = 0; begin < values.size(); begin += k) {
    const float* const value = values.data() + begin;
    uint8_t* const code = codes.data() + begin;
    for (size_t i = 0; i < k; ++i) {
      const float position = (value[i] - offset[i]) * inverse[i] + 0.5F;
      code[i] = static_cast<uint8_t>(static_cast<int32_t>(std::clamp(position, 0.0F, 255.0F)));
    }
  }
}

}  // namespace tessera
