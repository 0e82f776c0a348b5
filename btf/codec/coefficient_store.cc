#include "btf/codec/coefficient_store.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"

namespace tessera {
absl::StatusOr<std::unique_ptr<CoefficientStore>> CoefficientStore::Create(
    uint64_t num_values, uint64_t budget_bytes, const std::filesystem::path& spill_folder) {
  std::unique_ptr<CoefficientStore> store(new CoefficientStore());
  const uint64_t bytes = num_values * sizeof(float);
  if (bytes <= budget_bytes) {
    store->buffer_.Resize(num_values);
    return store;
  }
  TESSERA_ASSIGN_OR_RETURN(store->file_, SpillFile::Create(spill_folder, bytes));
  return store;
}

std::span<float> CoefficientStore::Buffer::Resize(uint64_t count) {
  if (count > size) {
    values = AllocateHuge<float>(count);
    size = count;
  }
  return {values.get(), count};
}

absl::Status CoefficientStore::Finish() {
  return writing_.valid() ? writing_.get() : absl::OkStatus();
}

std::span<float> CoefficientStore::BeginWrite(uint64_t begin, uint64_t count) {
  block_begin_ = begin;
  block_size_ = count;
  if (!is_spilled()) {
    return {buffer_.values.get() + begin, count};
  }
  return buffer_.Resize(count);
}

absl::Status CoefficientStore::EndWrite() {
  if (!is_spilled()) {
    return absl::OkStatus();
  }
  TESSERA_RETURN_IF_ERROR(Finish());
  std::swap(buffer_, written_);
  // Where there is no thread to be had, Finish() writes.
  writing_ = std::async(
      [this, offset = block_begin_ * sizeof(float), block = std::span(written_.values.get(), block_size_)] {
        return file_->Write(offset, std::as_bytes(block));
      });
  return absl::OkStatus();
}

absl::StatusOr<std::span<const float>> CoefficientStore::Read(uint64_t begin, uint64_t count,
                                                              std::vector<float>& scratch) const {
  if (!is_spilled()) {
    return std::span<const float>(buffer_.values.get() + begin, count);
  }
  scratch.resize(count);
  TESSERA_RETURN_IF_ERROR(file_->Read(begin * sizeof(float), std::as_writable_bytes(std::span(scratch))));
  return std::span<const float>(scratch);
}

absl::Status QuantizeAll(const CoefficientStore& store, const Quantisation& quantisation, CodeBuffer& codes,
                         const RunContext& context) {
  constexpr size_t kCodesPerBlock = size_t{16} << 20;  // whose pages are then dropped
  constexpr size_t kCodesPerTask = size_t{1} << 15;
  const size_t k = quantisation.offset.size();
  const size_t texels_per_block = std::max<size_t>(1, kCodesPerBlock / k);
  const auto texels_per_task = static_cast<int64_t>(std::max<size_t>(1, kCodesPerTask / k));
  const size_t num_texels = codes.size() / k;
  std::mutex mutex;  // guards `status`
  absl::Status status;
  for (size_t begin = 0; begin < num_texels; begin += texels_per_block) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const size_t end = std::min(begin + texels_per_block, num_texels);
    ParallelFor(context, static_cast<int64_t>(begin), static_cast<int64_t>(end), texels_per_task,
                [&](int64_t first, int64_t last) {
                  std::vector<float> scratch;
                  const size_t size = static_cast<size_t>(last - first) * k;
                  const auto values = store.Read(first * k, size, scratch);
                  if (!values.ok()) {
                    const std::lock_guard lock(mutex);
                    status.Update(values.status());
                    return;
                  }
                  Quantize(quantisation, *values, std::span(codes).subspan(first * k, size));
                });
    TESSERA_RETURN_IF_ERROR(status);
    codes.DropPages();
  }
  return context.CheckStop();
}

}  // namespace tessera
