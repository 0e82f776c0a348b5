#include "btf/codec/dsh/coefficient_store.h"

#include <cstdlib>
#include <utility>

#include "btf/base/huge_pages.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

std::unique_ptr<float[], FreeDeleter> Allocate(uint64_t count) {
  const size_t bytes = (count * sizeof(float) + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  void* const memory = std::aligned_alloc(kHugePageBytes, bytes);
  if (memory != nullptr) {
    AdviseHugePages(memory, bytes);
  }
  return std::unique_ptr<float[], FreeDeleter>(static_cast<float*>(memory));
}

}  // namespace

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
    values = Allocate(count);
    size = count;
  }
  return {values.get(), count};
}

absl::Status CoefficientStore::Wait() {
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
  TESSERA_RETURN_IF_ERROR(Wait());
  std::swap(buffer_, written_);
  writing_ = std::async(std::launch::async, [this, offset = block_begin_ * sizeof(float),
                                             block = std::span(written_.values.get(), block_size_)] {
    return file_->Write(offset, std::as_bytes(block));
  });
  return absl::OkStatus();
}

absl::StatusOr<std::span<const float>> CoefficientStore::Read(uint64_t begin, uint64_t count) {
  if (!is_spilled()) {
    return std::span<const float>(buffer_.values.get() + begin, count);
  }
  TESSERA_RETURN_IF_ERROR(Wait());
  const std::span<float> values = buffer_.Resize(count);
  TESSERA_RETURN_IF_ERROR(file_->Read(begin * sizeof(float), std::as_writable_bytes(values)));
  return std::span<const float>(values);
}

}  // namespace tessera
