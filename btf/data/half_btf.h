// A BTF held in memory as half floats: for work that reads a source many times which is slow to read, as a
// ray-traced one is.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/data/btf_source.h"

namespace tessera {

// Values are rounded to 11 bits; beyond kMaxHalf in magnitude they are kept at it; what is not a
// number stays so.
inline constexpr float kMaxHalf = 65504.0F;

class HalfBtf final : public BtfSource {
 public:
  // Reads all of `source` once; reports "read", "rows". Errors: RESOURCE_EXHAUSTED naming the bytes needed
  // when there are more than `limit_bytes`; those of the source; CANCELLED.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<HalfBtf>> CopyOf(BtfSource& source,
                                                                       uint64_t limit_bytes,
                                                                       const RunContext& context);
  // What a copy takes.
  [[nodiscard]] static uint64_t SizeBytes(const BtfSource& source);

  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override;

 private:
  explicit HalfBtf(BtfInfo info) : info_(std::move(info)) {}

  BtfInfo info_;
  std::vector<Eigen::half> samples_;
};

}  // namespace tessera
