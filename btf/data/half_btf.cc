#include "btf/data/half_btf.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/data/memory_btf.h"

namespace tessera {
namespace {

constexpr int64_t kSamplesPerTask = int64_t{1} << 18;
constexpr uint64_t kBlockBytes = uint64_t{32} << 20;

using Floats = Eigen::Array<float, Eigen::Dynamic, 1>;
using Halves = Eigen::Array<Eigen::half, Eigen::Dynamic, 1>;

}  // namespace

uint64_t HalfBtf::SizeBytes(const BtfSource& source) {
  return source.SamplesPerRow() * static_cast<uint64_t>(source.info().height) * sizeof(Eigen::half);
}

absl::StatusOr<std::unique_ptr<HalfBtf>> HalfBtf::CopyOf(BtfSource& source, uint64_t limit_bytes,
                                                         const RunContext& context) {
  if (SizeBytes(source) > limit_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("a copy of the BTF as half floats takes ",
                                                     SizeBytes(source), " bytes, at most ", limit_bytes));
  }
  std::unique_ptr<HalfBtf> copy(new HalfBtf(source.info()));
  copy->memory_.resize(source.SamplesPerRow() * source.info().height);
  copy->samples_ = copy->memory_;
  TESSERA_RETURN_IF_ERROR(copy->Fill(source, context));
  return copy;
}

absl::StatusOr<std::unique_ptr<HalfBtf>> HalfBtf::SpillingCopyOf(BtfSource& source,
                                                                 uint64_t memory_limit_bytes,
                                                                 const std::filesystem::path& spill_folder,
                                                                 const RunContext& context) {
  const uint64_t size_bytes = SizeBytes(source);
  if (size_bytes <= memory_limit_bytes) {
    return CopyOf(source, memory_limit_bytes, context);
  }
  std::unique_ptr<HalfBtf> copy(new HalfBtf(source.info()));
  TESSERA_ASSIGN_OR_RETURN(copy->file_, SpillFile::Create(spill_folder, size_bytes));
  TESSERA_ASSIGN_OR_RETURN(const std::span<std::byte> bytes, copy->file_->Map());
  copy->samples_ = {reinterpret_cast<Eigen::half*>(bytes.data()), size_bytes / sizeof(Eigen::half)};
  TESSERA_RETURN_IF_ERROR(copy->Fill(source, context));
  return copy;
}

void HalfBtf::DropPages() const {
  if (file_) {
    file_->DropPages();
  }
}

absl::Status HalfBtf::Fill(BtfSource& source, const RunContext& context) {
  const size_t row_samples = source.SamplesPerRow();
  const int height = source.info().height;
  const int block_rows =
      static_cast<int>(std::clamp<uint64_t>(kBlockBytes / (row_samples * sizeof(float)), 1, height));
  std::vector<float> block(block_rows * row_samples);
  RunContext silent = context;
  silent.progress = nullptr;
  for (int y = 0; y < height; y += block_rows) {
    context.Report("read", y, height, "rows");
    const int rows = std::min(block_rows, height - y);
    const std::span<float> samples = std::span(block).first(rows * row_samples);
    TESSERA_RETURN_IF_ERROR(source.ReadRows(y, rows, samples, silent));
    Eigen::half* to = samples_.data() + static_cast<size_t>(y) * row_samples;
    ParallelFor(context, 0, static_cast<int64_t>(samples.size()), kSamplesPerTask,
                [&](int64_t begin, int64_t end) {
                  for (int64_t i = begin; i < end; ++i) {
                    to[i] = static_cast<Eigen::half>(std::clamp(samples[i], -kMaxHalf, kMaxHalf));
                  }
                });
    DropPages();
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  context.Report("read", height, height, "rows");
  return absl::OkStatus();
}

absl::Status HalfBtf::ReadRows(int row_begin, int num_rows, std::span<float> samples,
                               const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckReadRows(*this, row_begin, num_rows, samples.size()));
  const Eigen::half* from = samples_.data() + static_cast<size_t>(row_begin) * SamplesPerRow();
  ParallelFor(context, 0, static_cast<int64_t>(samples.size()), kSamplesPerTask,
              [&](int64_t begin, int64_t end) {
                Eigen::Map<Floats>(samples.data() + begin, end - begin) =
                    Eigen::Map<const Halves>(from + begin, end - begin).cast<float>();
              });
  DropPages();
  return context.CheckStop();
}

}  // namespace tessera
