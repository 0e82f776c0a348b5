#include "btf/codec/row_passes.h"

#include <algorithm>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

// More rows at once gain nothing.
constexpr uint64_t kMaxRowBlockBytes = uint64_t{64} << 20;

}  // namespace

RowPasses::RowPasses(BtfSource& source, uint64_t block_bytes, int expected_passes, const RunContext& context)
    : source_(source), context_(context), source_context_(context), expected_(expected_passes) {
  const uint64_t row_bytes = source.SamplesPerRow() * sizeof(float);
  rows_per_block_ = static_cast<int>(std::clamp<uint64_t>(
      std::min(block_bytes, kMaxRowBlockBytes) / row_bytes, 1, static_cast<uint64_t>(source.info().height)));
  // One stage for the caller: the source's own rows are not told apart from their encoding.
  source_context_.progress = nullptr;
  buffer_ = AllocateHuge<float>(source.SamplesPerRow() * rows_per_block_);
}

absl::Status RowPasses::Run(const std::function<absl::Status(const SampleBlock&)>& visit) {
  const int height = source_.info().height;
  for (int row = 0; row < height; row += rows_per_block_) {
    context_.Report("encode", static_cast<uint64_t>(done_) * height + row,
                    static_cast<uint64_t>(std::max(expected_, done_ + 1)) * height, "rows");
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    const int num_rows = std::min(rows_per_block_, height - row);
    const SampleBlock block{row, num_rows, static_cast<int64_t>(num_rows) * source_.info().width,
                            std::span(buffer_.get(), source_.SamplesPerRow() * num_rows)};
    TESSERA_RETURN_IF_ERROR(source_.ReadRows(row, num_rows, block.samples, source_context_));
    TESSERA_RETURN_IF_ERROR(visit(block));
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
  }
  ++done_;
  return absl::OkStatus();
}

void RowPasses::Finish() const {
  const uint64_t rows = static_cast<uint64_t>(done_) * source_.info().height;
  context_.Report("encode", rows, rows, "rows");
}

}  // namespace tessera
