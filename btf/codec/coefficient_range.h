// How large the coefficients of a table get, for those who store them otherwise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "btf/codec/btfel_table.h"

namespace tessera {

// [k]: the largest magnitude of each coefficient's value in any BTFel; 0 without BTFels. The codes are whole
// BTFels, offset and step have k elements.
[[nodiscard]] inline std::vector<double> LargestMagnitudes(const BtfelTable& table) {
  const auto k = static_cast<size_t>(table.num_coefficients);
  std::vector<uint8_t> lowest(k, 255);
  std::vector<uint8_t> highest(k, 0);
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const uint8_t* const codes = table.codes.data() + btfel * k;
    for (size_t i = 0; i < k; ++i) {
      lowest[i] = std::min(lowest[i], codes[i]);
      highest[i] = std::max(highest[i], codes[i]);
    }
  }
  std::vector<double> largest(k, 0.0);
  for (size_t i = 0; i < k && table.size() > 0; ++i) {
    const auto value = [&](uint8_t code) {
      return std::abs(table.offset[i] + static_cast<double>(table.step[i]) * code);
    };
    largest[i] = std::max(value(lowest[i]), value(highest[i]));
  }
  return largest;
}

}  // namespace tessera
