#include <algorithm>
#include <cerrno>
#include <cstring>
#include <new>
#include <string>
#include <utility>

#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <absl/strings/str_cat.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"
#include "btf/data/transposed_samples.h"

namespace tessera {

namespace {

class MemoryStorage : public SampleStorage {
 public:
  explicit MemoryStorage(std::unique_ptr<std::byte[]> bytes) : bytes_(std::move(bytes)) {}

  [[nodiscard]] absl::Status Write(uint64_t offset, std::span<const std::byte> bytes) override {
    std::memcpy(bytes_.get() + offset, bytes.data(), bytes.size());
    return absl::OkStatus();
  }
  [[nodiscard]] absl::Status Read(uint64_t offset, std::span<std::byte> bytes) override {
    std::memcpy(bytes.data(), bytes_.get() + offset, bytes.size());
    return absl::OkStatus();
  }

 private:
  std::unique_ptr<std::byte[]> bytes_;
};

// Plain reads and writes, not a mapping: mapped pages would count as ours and a full disk would be a signal.
class FileStorage : public SampleStorage {
 public:
  FileStorage(int descriptor, std::string name) : descriptor_(descriptor), name_(std::move(name)) {}
  ~FileStorage() override { close(descriptor_); }
  FileStorage(const FileStorage&) = delete;
  FileStorage& operator=(const FileStorage&) = delete;

  [[nodiscard]] absl::Status Write(uint64_t offset, std::span<const std::byte> bytes) override {
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
  [[nodiscard]] absl::Status Read(uint64_t offset, std::span<std::byte> bytes) override {
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

 private:
  int descriptor_;
  std::string name_;
};

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
  struct statvfs volume {};
  if (fstatvfs(descriptor, &volume) != 0) {
    return FileError(errno, "cannot be examined", name);
  }
  const uint64_t free_bytes = uint64_t{volume.f_bavail} * volume.f_frsize;
  const auto too_little = [&] {
    return absl::ResourceExhaustedError(
        absl::StrCat(name, ": the spill file needs ", size_bytes, " bytes, ", free_bytes, " are free"));
  };
  if (size_bytes > free_bytes) {
    return too_little();
  }
  // Claims the blocks now, so that nobody else can take them before they are written.
  if (fallocate(descriptor, 0, 0, static_cast<off_t>(size_bytes)) != 0 && errno != EOPNOTSUPP) {
    return errno == ENOSPC || errno == EDQUOT || errno == EFBIG
               ? too_little()
               : FileError(errno, "cannot reserve space", name);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<SampleStorage>> MakeMemoryStorage(uint64_t size_bytes) {
  std::unique_ptr<std::byte[]> bytes(new (std::nothrow) std::byte[size_bytes]);
  if (bytes == nullptr) {
    return absl::ResourceExhaustedError(absl::StrCat("no ", size_bytes, " bytes of memory for the samples"));
  }
  return std::make_unique<MemoryStorage>(std::move(bytes));
}

absl::StatusOr<std::unique_ptr<SampleStorage>> MakeSpillFile(const std::filesystem::path& folder,
                                                             uint64_t size_bytes) {
  const std::string name = folder.string();
  const int descriptor = OpenNameless(folder);
  if (descriptor < 0) {
    return FileError(errno, "cannot create a spill file", name);
  }
  auto storage = std::make_unique<FileStorage>(descriptor, absl::StrCat("spill file in ", name));
  TESSERA_RETURN_IF_ERROR(ReserveSpace(descriptor, size_bytes, name));
  return storage;
}

}  // namespace tessera
