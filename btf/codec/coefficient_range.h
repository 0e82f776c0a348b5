// How large the coefficients of a table get, for those who store them otherwise.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

#include "btf/codec/btfel_table.h"

namespace tessera {

// Whether `more` go with `table`: as many coefficients, each with an offset and a step, and whole BTFels.
// Errors: INVALID_ARGUMENT naming the first that does not.
[[nodiscard]] inline absl::Status CheckSameCoefficients(const BtfelTable& table,
                                                        std::span<const BtfelTable* const> more) {
  const auto k = static_cast<size_t>(table.num_coefficients);
  for (size_t i = 0; i < more.size(); ++i) {
    const BtfelTable& other = *more[i];
    if (std::cmp_not_equal(other.num_coefficients, k) || other.offset.size() != k || other.step.size() != k ||
        other.codes.size() % k != 0) {
      return absl::InvalidArgumentError(absl::StrCat("further table ", i, ": ", other.num_coefficients,
                                                     " coefficients with ", other.offset.size(), " offsets, ",
                                                     other.step.size(), " steps and ", other.codes.size(),
                                                     " codes; the first table has ", k));
    }
  }
  return absl::OkStatus();
}

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

// The same over `table` and `more`, which go with it.
[[nodiscard]] inline std::vector<double> LargestMagnitudes(const BtfelTable& table,
                                                           std::span<const BtfelTable* const> more) {
  std::vector<double> largest = LargestMagnitudes(table);
  for (const BtfelTable* const other : more) {
    std::ranges::transform(largest, LargestMagnitudes(*other), largest.begin(),
                           [](double a, double b) { return std::max(a, b); });
  }
  return largest;
}

// How many BTFels they have in all.
[[nodiscard]] inline size_t TotalSize(const BtfelTable& table, std::span<const BtfelTable* const> more) {
  size_t size = table.size();
  for (const BtfelTable* const other : more) {
    size += other->size();
  }
  return size;
}

}  // namespace tessera
