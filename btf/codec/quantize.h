// Uniform 8-bit quantisation, one (offset, step) for each coefficient. Source: [Leung2007] 3.1, 5.
//
//   Quantisation q = UniformQuantisation(minima, maxima);
//   Quantize(q, values, codes);       // |values - (offset + step * code)| <= (1/2 + kQuantizeRounding) step
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

// Rounding of offset and step to float, and of the division, in steps.
inline constexpr double kQuantizeRounding = 1e-3;

struct Quantisation {
  std::vector<float> offset;  // [k], the smallest value
  std::vector<float> step;    // [k], (largest - smallest) / 255; 0 where all values are equal
};

// Both spans have k finite elements, minima <= maxima.
[[nodiscard]] Quantisation UniformQuantisation(std::span<const float> minima, std::span<const float> maxima);

// values and codes are [n][k]; every value lies between its coefficient's minimum and maximum.
void Quantize(const Quantisation& quantisation, std::span<const float> values, std::span<uint8_t> codes);

}  // namespace tessera
