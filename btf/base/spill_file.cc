#include "btf/base/spill_file.h"

#include <cerrno>
#include <cstdlib>
#include <string_view>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

// A file that no folder lists, -1 and errno on failure.
int OpenNameless(const std::filesystem::path& folder) {
  const int descriptor = open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (descriptor >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL)) {
    return descriptor;
  }
  // The file system cannot: make a file and take its name away at once.
  std::string name = (folder / "tessera-spill-XXXXXX").string();
  const int named = mkostemp(name.data(), O_CLOEXEC);
  if (named >= 0) {
    unlink(name.c_str());
  }
  return named;
}

absl::Status ReserveSpace(int descriptor, uint64_t size_bytes, const std::string& name) {
  if (size_bytes == 0) {
    return absl::OkStatus();
  }
  struct statvfs volume {};
  if (fstatvfs(descriptor, &volume) != 0) {
    return FileError(errno, "cannot be examined", name);
  }
  const uint64_t free_bytes = uint64_t{volume.f_bavail} * volume.f_frsize;
  const auto too_little = [&] {
    return absl::ResourceExhaustedError(
        absl::StrCat(name, ": ", size_bytes, " bytes are needed, ", free_bytes, " are free"));
  };
  if (size_bytes > free_bytes) {
    return too_little();
  }
  // Where the file system cannot reserve, the library writes to every block instead.
  int error_number = EINTR;
  while (error_number == EINTR) {
    error_number = posix_fallocate(descriptor, 0, static_cast<off_t>(size_bytes));
  }
  if (error_number == ENOSPC || error_number == EDQUOT || error_number == EFBIG) {
    return too_little();
  }
  return error_number == 0 ? absl::OkStatus() : FileError(error_number, "cannot reserve space", name);
}

}  // namespace

absl::StatusOr<SpillFile> SpillFile::Create(const std::filesystem::path& folder, uint64_t size_bytes) {
  std::filesystem::path place = folder;
  if (place.empty()) {
    std::error_code error;
    place = std::filesystem::temp_directory_path(error);
    if (error) {
      return FileError(error.value(), "cannot find the folder for temporary files", "TMPDIR");
    }
  }
  const int descriptor = OpenNameless(place);
  if (descriptor < 0) {
    return FileError(errno, "cannot create a spill file", place.string());
  }
  SpillFile file(descriptor, size_bytes, absl::StrCat("spill file in ", place.string()));
  TESSERA_RETURN_IF_ERROR(ReserveSpace(descriptor, size_bytes, file.name_));
  return file;
}

SpillFile::SpillFile(int descriptor, uint64_t size_bytes, std::string name)
    : descriptor_(descriptor), size_bytes_(size_bytes), name_(std::move(name)) {}

SpillFile::SpillFile(SpillFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      size_bytes_(other.size_bytes_),
      mapped_(std::exchange(other.mapped_, nullptr)),
      name_(std::move(other.name_)) {}

SpillFile& SpillFile::operator=(SpillFile&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(size_bytes_, other.size_bytes_);
  std::swap(mapped_, other.mapped_);
  std::swap(name_, other.name_);
  return *this;
}

SpillFile::~SpillFile() {
  if (mapped_ != nullptr) {
    munmap(mapped_, size_bytes_);
  }
  if (descriptor_ >= 0) {
    close(descriptor_);
  }
}

absl::Status SpillFile::Write(uint64_t offset, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      return FileError(errno, "cannot write", name_);
    }
    bytes = bytes.subspan(static_cast<size_t>(count));
    offset += static_cast<uint64_t>(count);
  }
  return absl::OkStatus();
}

absl::Status SpillFile::Read(uint64_t offset, std::span<std::byte> bytes) const {
  while (!bytes.empty()) {
    const ssize_t count = pread(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count <= 0) {
      return count < 0 ? FileError(errno, "cannot read", name_)
                       : absl::DataLossError(absl::StrCat(name_, ": shorter than written"));
    }
    bytes = bytes.subspan(static_cast<size_t>(count));
    offset += static_cast<uint64_t>(count);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::span<std::byte>> SpillFile::Map() {
  if (mapped_ == nullptr && size_bytes_ > 0) {
    void* const address = mmap(nullptr, size_bytes_, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor_, 0);
    if (address == MAP_FAILED) {
      return FileError(errno, "cannot be mapped", name_);
    }
    mapped_ = address;
  }
  return std::span(static_cast<std::byte*>(mapped_), size_bytes_);
}

void SpillFile::DropPages() const {
  if (mapped_ != nullptr) {
    // The mapping is shared: what was written stays in the file's pages.
    madvise(mapped_, size_bytes_, MADV_DONTNEED);
  }
}

}  // namespace tessera
