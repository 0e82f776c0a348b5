// Numbers in few bytes: binary decisions by range coding [Martin 1979], each with a probability that follows
// what came before it in its context. Writing and reading keep the same contexts.
//
//   RangeWriter writer;
//   AdaptiveBit bit;                        // one a context
//   writer.Write(true, bit);
//   std::vector<uint8_t> bytes = std::move(writer).Finish();
//   RangeReader reader(bytes);
//   AdaptiveBit again;
//   bool value = reader.Read(again);        // true
//   TESSERA_RETURN_IF_ERROR(reader.CheckEnd());
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <absl/status/status.h>

namespace tessera {

// How likely 0 is: the mean of two estimates, one that adapts at once and one that adapts slowly.
class AdaptiveBit {
 public:
  // Of 2^16.
  [[nodiscard]] uint32_t zero() const { return (fast_ + slow_) / 2; }
  void Update(bool bit) {
    fast_ += ((bit ? kLeast : kMost) - fast_) / 16;
    slow_ += ((bit ? kLeast : kMost) - slow_) / 128;
  }

 private:
  // Neither outcome is ever impossible.
  static constexpr int32_t kLeast = 32;
  static constexpr int32_t kMost = 65536 - kLeast;
  int32_t fast_ = 32768;
  int32_t slow_ = 32768;
};

class RangeWriter {
 public:
  void Write(bool bit, AdaptiveBit& context);
  // Bytes that the reader takes for the last ones, and zeros behind them.
  [[nodiscard]] std::vector<uint8_t> Finish() &&;

 private:
  void Shift();

  uint64_t low_ = 0;
  uint32_t range_ = 0xffffffffU;
  std::vector<uint8_t> bytes_;
};

// Safe on hostile bytes: what is read from them is as good as any.
class RangeReader {
 public:
  // `bytes` outlive it.
  explicit RangeReader(std::span<const uint8_t> bytes);
  [[nodiscard]] bool Read(AdaptiveBit& context);
  // Errors: INVALID_ARGUMENT where bytes are left.
  [[nodiscard]] absl::Status CheckEnd() const;

 private:
  uint32_t Next();

  std::span<const uint8_t> bytes_;
  size_t next_ = 0;  // goes on behind the end
  uint32_t code_ = 0;
  uint32_t range_ = 0xffffffffU;
};

// A whole number above -2^31 in a context: whether it is 0, its sign, its size by Elias gamma code.
class AdaptiveNumber {
 public:
  void Write(int32_t value, RangeWriter& writer);
  [[nodiscard]] int32_t Read(RangeReader& reader);

 private:
  static constexpr size_t kMostBits = 31;

  AdaptiveBit is_zero_;
  AdaptiveBit is_negative_;
  std::array<AdaptiveBit, kMostBits> is_longer_;
  std::array<AdaptiveBit, kMostBits> high_bit_;  // behind the leading one, of this length
  std::array<AdaptiveBit, kMostBits> low_bits_;
};

// Numbers of which those around each tell how large it is: the one before, and those `stride` before these.
[[nodiscard]] std::vector<uint8_t> WriteNumbers(std::span<const int32_t> numbers, size_t stride);
// Errors: INVALID_ARGUMENT where bytes are left.
[[nodiscard]] absl::Status ReadNumbers(std::span<const uint8_t> bytes, size_t stride,
                                       std::span<int32_t> numbers);

}  // namespace tessera
