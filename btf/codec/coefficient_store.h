// Where an encoder keeps its float coefficients until their range is known: in memory while a budget allows
// it, else in a spill file.
//
//   TESSERA_ASSIGN_OR_RETURN(auto store, CoefficientStore::Create(num_values, budget_bytes, spill_folder));
//   std::span<float> block = store->BeginWrite(begin, count);  // fill it, then
//   TESSERA_RETURN_IF_ERROR(store->EndWrite());
//   TESSERA_RETURN_IF_ERROR(QuantizeAll(*store, quantisation, codes, context));
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/huge_pages.h"
#include "btf/base/run_context.h"
#include "btf/base/spill_file.h"
#include "btf/codec/code_buffer.h"
#include "btf/codec/quantize.h"

namespace tessera {

// Not thread-safe; the span of a block may be filled by many threads.
class CoefficientStore {
 public:
  // For `num_values` floats; in a SpillFile in `spill_folder` when they exceed the budget. Errors:
  // SpillFile::Create's.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<CoefficientStore>> Create(
      uint64_t num_values, uint64_t budget_bytes, const std::filesystem::path& spill_folder);
  CoefficientStore(const CoefficientStore&) = delete;
  CoefficientStore& operator=(const CoefficientStore&) = delete;

  [[nodiscard]] bool is_spilled() const { return file_.has_value(); }

  // Room for values [begin, begin + count), valid until the next call.
  [[nodiscard]] std::span<float> BeginWrite(uint64_t begin, uint64_t count);
  // A spilled block is written while the next one is filled: there are two in memory. Errors:
  // SpillFile::Write's, of this block or the one before.
  [[nodiscard]] absl::Status EndWrite();
  // Ends writing: what was written may be read. Errors: SpillFile::Write's, of the last block.
  [[nodiscard]] absl::Status Finish();

  // Values [begin, begin + count), in `scratch` where they come from the file. Thread-safe. Errors:
  // SpillFile::Read's.
  [[nodiscard]] absl::StatusOr<std::span<const float>> Read(uint64_t begin, uint64_t count,
                                                            std::vector<float>& scratch) const;

 private:
  CoefficientStore() = default;

  struct Buffer {
    HugeBuffer<float> values;
    uint64_t size = 0;

    // Not zeroed: the threads that fill it also fault its pages in.
    std::span<float> Resize(uint64_t count);
  };

  std::optional<SpillFile> file_;
  Buffer buffer_;  // of all values, or of the block in use
  uint64_t block_begin_ = 0;
  uint64_t block_size_ = 0;
  Buffer written_;                     // the block before, which writing_ reads
  std::future<absl::Status> writing_;  // the last member: its destructor waits
};

// The codes of all values of a finished store, as many as `codes` has. Errors: Read's; CANCELLED.
[[nodiscard]] absl::Status QuantizeAll(const CoefficientStore& store, const Quantisation& quantisation,
                                       CodeBuffer& codes, const RunContext& context);

}  // namespace tessera
