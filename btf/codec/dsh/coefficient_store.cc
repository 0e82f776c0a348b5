#include "btf/codec/dsh/coefficient_store.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>

#include <absl/strings/str_cat.h>
#include <sys/mman.h>
#include <unistd.h>

namespace tessera {
namespace {

absl::Status FileError(const char* what) {
  const int error = errno;
  const std::string message =
      absl::StrCat("temporary file of coefficients: ", what, ": ", std::strerror(error));
  return error == ENOSPC || error == EDQUOT ? absl::ResourceExhaustedError(message)
                                            : absl::UnavailableError(message);
}

// In huge pages where the system grants them: faulting in 4 KiB at a time costs more than the values'
// computation.
std::unique_ptr<float[], FreeDeleter> Allocate(uint64_t count) {
  constexpr size_t kHugePageBytes = size_t{2} << 20;
  const size_t bytes = (count * sizeof(float) + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  void* const memory = std::aligned_alloc(kHugePageBytes, bytes);
  if (memory != nullptr) {
    madvise(memory, bytes, MADV_HUGEPAGE);
  }
  return std::unique_ptr<float[], FreeDeleter>(static_cast<float*>(memory));
}

}  // namespace

absl::StatusOr<std::unique_ptr<CoefficientStore>> CoefficientStore::Create(uint64_t num_values,
                                                                           uint64_t budget_bytes) {
  std::unique_ptr<CoefficientStore> store(new CoefficientStore());
  const uint64_t bytes = num_values * sizeof(float);
  if (bytes <= budget_bytes) {
    store->Resize(num_values);
    return store;
  }
  std::error_code error;
  const std::filesystem::path folder = std::filesystem::temp_directory_path(error);
  if (error) {
    return absl::UnavailableError(absl::StrCat("temporary folder: ", error.message()));
  }
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  if (!error && space.available < bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("temporary folder: ", bytes, " bytes of coefficients, ",
                                                     space.available, " bytes are free"));
  }
  std::string name = (folder / "tessera-coefficients-XXXXXX").string();
  store->file_ = mkstemp(name.data());
  if (store->file_ < 0) {
    return FileError("create");
  }
  unlink(name.c_str());
  return store;
}

CoefficientStore::~CoefficientStore() {
  if (file_ >= 0) {
    close(file_);
  }
}

std::span<float> CoefficientStore::Resize(uint64_t count) {
  if (count > num_values_) {
    values_ = Allocate(count);
    num_values_ = count;
  }
  return {values_.get(), count};
}

std::span<float> CoefficientStore::BeginWrite(uint64_t begin, uint64_t count) {
  block_begin_ = begin;
  block_size_ = count;
  if (!is_spilled()) {
    return {values_.get() + begin, count};
  }
  return Resize(count);
}

absl::Status CoefficientStore::EndWrite() {
  if (!is_spilled()) {
    return absl::OkStatus();
  }
  const char* bytes = reinterpret_cast<const char*>(values_.get());
  size_t left = block_size_ * sizeof(float);
  off_t offset = static_cast<off_t>(block_begin_ * sizeof(float));
  while (left > 0) {
    const ssize_t written = pwrite(file_, bytes, left, offset);
    if (written < 0 && errno == EINTR) {
      continue;
    }
    if (written <= 0) {
      return FileError("write");
    }
    bytes += written;
    offset += written;
    left -= static_cast<size_t>(written);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::span<const float>> CoefficientStore::Read(uint64_t begin, uint64_t count) {
  if (!is_spilled()) {
    return std::span<const float>(values_.get() + begin, count);
  }
  const std::span<float> values = Resize(count);
  char* bytes = reinterpret_cast<char*>(values.data());
  size_t left = count * sizeof(float);
  off_t offset = static_cast<off_t>(begin * sizeof(float));
  while (left > 0) {
    const ssize_t got = pread(file_, bytes, left, offset);
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got <= 0) {
      return FileError(got == 0 ? "read beyond its end" : "read");
    }
    bytes += got;
    offset += got;
    left -= static_cast<size_t>(got);
  }
  return std::span<const float>(values);
}

}  // namespace tessera
