// Reading a source once for every pass of an encoder, a block of rows at a time, with one count of rows over
// all passes.
//
//   RowPasses passes(source, budget_bytes / 4, /*expected_passes=*/2, context);
//   TESSERA_RETURN_IF_ERROR(passes.Run([&](const SampleBlock& block) -> absl::Status { ... }));
//   TESSERA_RETURN_IF_ERROR(passes.Run(..));
//   passes.Finish();
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include <absl/status/status.h>

#include "btf/base/huge_pages.h"
#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Rows of samples in the layout of BtfSource::ReadRows. A visitor may change them.
struct SampleBlock {
  int row = 0;  // the first
  int num_rows = 0;
  int64_t num_texels = 0;
  std::span<float> samples;
};

// Borrows the source and the context. Not thread-safe.
class RowPasses {
 public:
  // Blocks take `block_bytes` at most, 64 MiB at most, but one row at least.
  RowPasses(BtfSource& source, uint64_t block_bytes, int expected_passes, const RunContext& context);

  [[nodiscard]] int rows_per_block() const { return rows_per_block_; }

  // Calls `visit` for all blocks in order. Errors: the source's, the visitor's, CANCELLED.
  [[nodiscard]] absl::Status Run(const std::function<absl::Status(const SampleBlock&)>& visit);
  // Reports that no pass follows.
  void Finish() const;
  void ExpectMore(int passes) { expected_ += passes; }

 private:
  BtfSource& source_;
  const RunContext& context_;
  RunContext source_context_;
  int rows_per_block_ = 1;
  int expected_;
  int done_ = 0;
  HugeBuffer<float> buffer_;
};

}  // namespace tessera
