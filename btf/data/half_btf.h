// A copy of a BTF as half floats, in memory or in a spill file: for work that reads a source many times which
// is slow to read, as a ray-traced one is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/spill_file.h"
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
  // The same, where `memory_limit_bytes` do not hold it in a nameless file in `spill_folder` (empty: the
  // system's), of which no more than a block at a time counts as this process's memory. Errors:
  // SpillFile::Create's; those of the source; CANCELLED.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<HalfBtf>> SpillingCopyOf(
      BtfSource& source, uint64_t memory_limit_bytes, const std::filesystem::path& spill_folder,
      const RunContext& context);
  // What a copy takes.
  [[nodiscard]] static uint64_t SizeBytes(const BtfSource& source);

  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override;

 private:
  explicit HalfBtf(BtfInfo info) : info_(std::move(info)) {}
  // Fills samples_ from the source, block by block.
  [[nodiscard]] absl::Status Fill(BtfSource& source, const RunContext& context);
  void DropPages() const;

  BtfInfo info_;
  std::vector<Eigen::half> memory_;
  std::optional<SpillFile> file_;
  std::span<Eigen::half> samples_;  // of either
};

}  // namespace tessera
