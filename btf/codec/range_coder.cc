#include "btf/codec/range_coder.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <utility>

#include <absl/strings/str_cat.h>

namespace tessera {
namespace {

constexpr uint32_t kLeastRange = uint32_t{1} << 24;
constexpr size_t kCodeBytes = 4;

// Contexts of numbers that stand in rows of `stride`.
class NumberContexts {
 public:
  explicit NumberContexts(size_t stride) : stride_(std::max<size_t>(stride, 1)) {}

  // Of the number behind `before`.
  [[nodiscard]] AdaptiveNumber& Find(std::span<const int32_t> before) {
    const auto size = [&](size_t back) {
      return back <= before.size() ? std::min<uint32_t>(std::abs(before[before.size() - back]), kMostSize)
                                   : 0U;
    };
    const uint32_t sum = 2 * size(1) + 2 * size(stride_) + size(2) + size(stride_ + 1) + size(2 * stride_);
    return contexts_[std::min<size_t>(std::bit_width(sum), contexts_.size() - 1)];
  }

 private:
  static constexpr uint32_t kMostSize = 1 << 12;

  size_t stride_;
  std::array<AdaptiveNumber, 10> contexts_;
};

}  // namespace

void RangeWriter::Shift() {
  bytes_.push_back(static_cast<uint8_t>(low_ >> 24));
  low_ = low_ << 8 & 0xffffffffU;
  range_ <<= 8;
}

void RangeWriter::Write(bool bit, AdaptiveBit& context) {
  const uint32_t zero = (range_ >> 16) * context.zero();
  if (bit) {
    low_ += zero;
    range_ -= zero;
    if (low_ >> 32 != 0) {
      // The sum carries into bytes that are written.
      low_ &= 0xffffffffU;
      for (auto byte = bytes_.rbegin(); ++*byte == 0; ++byte) {
      }
    }
  } else {
    range_ = zero;
  }
  context.Update(bit);
  while (range_ < kLeastRange) {
    Shift();
  }
}

std::vector<uint8_t> RangeWriter::Finish() && {
  for (size_t i = 0; i < kCodeBytes; ++i) {
    Shift();
  }
  while (!bytes_.empty() && bytes_.back() == 0) {
    bytes_.pop_back();
  }
  return std::move(bytes_);
}

RangeReader::RangeReader(std::span<const uint8_t> bytes) : bytes_(bytes) {
  for (size_t i = 0; i < kCodeBytes; ++i) {
    code_ = code_ << 8 | Next();
  }
}

uint32_t RangeReader::Next() {
  const uint32_t byte = next_ < bytes_.size() ? bytes_[next_] : 0U;
  ++next_;
  return byte;
}

bool RangeReader::Read(AdaptiveBit& context) {
  const uint32_t zero = (range_ >> 16) * context.zero();
  const bool bit = code_ >= zero;
  if (bit) {
    code_ -= zero;
    range_ -= zero;
  } else {
    range_ = zero;
  }
  context.Update(bit);
  while (range_ < kLeastRange) {
    code_ = code_ << 8 | Next();
    range_ <<= 8;
  }
  return bit;
}

absl::Status RangeReader::CheckEnd() const {
  return next_ >= bytes_.size() ? absl::OkStatus()
                                : absl::InvalidArgumentError(absl::StrCat("the numbers end after ", next_,
                                                                          " of ", bytes_.size(), " bytes"));
}

void AdaptiveNumber::Write(int32_t value, RangeWriter& writer) {
  writer.Write(value == 0, is_zero_);
  if (value == 0) {
    return;
  }
  writer.Write(value < 0, is_negative_);
  const uint32_t size = value < 0 ? 0U - static_cast<uint32_t>(value) : static_cast<uint32_t>(value);
  const size_t bits = std::min<size_t>(std::bit_width(size), kMostBits);  // 1 for 1
  for (size_t i = 1; i <= bits && i < kMostBits; ++i) {
    writer.Write(i < bits, is_longer_[i]);
  }
  for (size_t i = bits - 1; i > 0; --i) {
    writer.Write((size >> (i - 1) & 1U) != 0, i == bits - 1 ? high_bit_[i] : low_bits_[i]);
  }
}

int32_t AdaptiveNumber::Read(RangeReader& reader) {
  if (reader.Read(is_zero_)) {
    return 0;
  }
  const bool is_negative = reader.Read(is_negative_);
  size_t bits = 1;
  while (bits < kMostBits && reader.Read(is_longer_[bits])) {
    ++bits;
  }
  uint32_t size = 1;
  for (size_t i = bits - 1; i > 0; --i) {
    size = size << 1 | static_cast<uint32_t>(reader.Read(i == bits - 1 ? high_bit_[i] : low_bits_[i]));
  }
  return is_negative ? -static_cast<int32_t>(size) : static_cast<int32_t>(size);
}

std::vector<uint8_t> WriteNumbers(std::span<const int32_t> numbers, size_t stride) {
  RangeWriter writer;
  NumberContexts contexts(stride);
  for (size_t i = 0; i < numbers.size(); ++i) {
    contexts.Find(numbers.first(i)).Write(numbers[i], writer);
  }
  return std::move(writer).Finish();
}

absl::Status ReadNumbers(std::span<const uint8_t> bytes, size_t stride, std::span<int32_t> numbers) {
  RangeReader reader(bytes);
  NumberContexts contexts(stride);
  for (size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = contexts.Find(numbers.first(i)).Read(reader);
  }
  return reader.CheckEnd();
}

}  // namespace tessera
