// Native samples of an image to linear floats, through a table where the samples are at most 16 bits wide.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "btf/image/image_reader.h"
#include "btf/image/transfer.h"

namespace tessera {

class SampleTable {
 public:
  SampleTable(SampleType type, const Transfer& transfer);

  [[nodiscard]] SampleType type() const { return type_; }
  // Linear values of every code, [256] or [65536]; empty for kFloat.
  [[nodiscard]] std::span<const float> values() const { return values_; }

  // linear[i] from sample i; samples.size() must be linear.size() * SampleBytes(type()), aligned for the
  // type.
  void Convert(std::span<const std::byte> samples, std::span<float> linear) const;

 private:
  SampleType type_;
  Transfer transfer_;
  std::vector<float> values_;
};

// Index of the first sample that is infinite or not a number, samples.size() / SampleBytes(type) if there is
// none. Aligned for the type.
[[nodiscard]] size_t FirstNotFinite(SampleType type, std::span<const std::byte> samples);

}  // namespace tessera
