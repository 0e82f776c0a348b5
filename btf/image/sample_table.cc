#include "btf/image/sample_table.h"

#include <cmath>
#include <cstdint>

#include <Imath/half.h>

namespace tessera {

namespace {

template <typename T>
const T* As(std::span<const std::byte> samples) {
  return reinterpret_cast<const T*>(samples.data());
}

template <typename T>
void LookUp(const T* codes, std::span<const float> values, std::span<float> linear) {
  for (size_t i = 0; i < linear.size(); ++i) {
    linear[i] = values[codes[i]];
  }
}

// First index of a value whose exponent bits are all ones. Counts by blocks, so that the scan vectorises.
template <typename T>
size_t FirstWithFullExponent(const T* bits, size_t count, T exponent) {
  constexpr size_t kBlock = 256;
  for (size_t begin = 0; begin < count; begin += kBlock) {
    const size_t end = std::min(count, begin + kBlock);
    unsigned bad = 0;
    for (size_t i = begin; i < end; ++i) {
      bad |= static_cast<unsigned>((bits[i] & exponent) == exponent);
    }
    for (size_t i = begin; bad != 0 && i < end; ++i) {
      if ((bits[i] & exponent) == exponent) {
        return i;
      }
    }
  }
  return count;
}

}  // namespace

SampleTable::SampleTable(SampleType type, const Transfer& transfer) : type_(type), transfer_(transfer) {
  if (type == SampleType::kFloat) {
    return;
  }
  values_.resize(type == SampleType::kU8 ? 256 : 65536);
  for (size_t code = 0; code < values_.size(); ++code) {
    double encoded = static_cast<double>(code) / static_cast<double>(values_.size() - 1);
    if (type == SampleType::kHalf) {
      half value;
      value.setBits(static_cast<uint16_t>(code));
      encoded = static_cast<float>(value);
    }
    values_[code] = static_cast<float>(LinearFromEncoded(transfer, encoded));
  }
}

void SampleTable::Convert(std::span<const std::byte> samples, std::span<float> linear) const {
  switch (type_) {
    case SampleType::kU8:
      LookUp(As<uint8_t>(samples), values_, linear);
      return;
    case SampleType::kU16:
    case SampleType::kHalf:
      LookUp(As<uint16_t>(samples), values_, linear);
      return;
    case SampleType::kFloat:
      break;
  }
  const float* const floats = As<float>(samples);
  for (size_t i = 0; i < linear.size(); ++i) {
    linear[i] = transfer_.kind == TransferKind::kLinear
                    ? floats[i]
                    : static_cast<float>(LinearFromEncoded(transfer_, floats[i]));
  }
}

size_t FirstNotFinite(SampleType type, std::span<const std::byte> samples) {
  const size_t count = samples.size() / SampleBytes(type);
  switch (type) {
    case SampleType::kHalf:
      return FirstWithFullExponent<uint16_t>(As<uint16_t>(samples), count, 0x7c00);
    case SampleType::kFloat:
      return FirstWithFullExponent<uint32_t>(As<uint32_t>(samples), count, 0x7f800000);
    default:
      return count;
  }
}

}  // namespace tessera
