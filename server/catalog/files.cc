#include "server/catalog/files.h"

#include <cerrno>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "btf/base/status_macros.h"
#include "server/catalog/storage_error.h"

namespace tessera {

File& File::operator=(File&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

File::~File() {
  if (descriptor_ >= 0) {
    close(descriptor_);
  }
}

absl::StatusOr<File> File::Open(const std::filesystem::path& path, int flags) {
  const int descriptor = open(path.c_str(), flags | O_CLOEXEC, 0640);
  if (descriptor < 0) {
    return errno == ENOENT ? absl::NotFoundError("a stored file is missing")
                           : StatusFromErrno(errno, "open a file");
  }
  return File(descriptor);
}

absl::Status File::WriteAt(uint64_t offset, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0) {
      if (errno == EINTR) {
        continue;
      }
      return StatusFromErrno(errno, "write a file");
    }
    offset += static_cast<uint64_t>(written);
    bytes = bytes.subspan(static_cast<size_t>(written));
  }
  return absl::OkStatus();
}

absl::StatusOr<size_t> File::ReadAt(uint64_t offset, std::span<std::byte> bytes) const {
  size_t total = 0;
  while (total < bytes.size()) {
    const ssize_t count =
        pread(descriptor_, bytes.data() + total, bytes.size() - total, static_cast<off_t>(offset + total));
    if (count < 0) {
      if (errno == EINTR) {
        continue;
      }
      return StatusFromErrno(errno, "read a file");
    }
    if (count == 0) {
      break;
    }
    total += static_cast<size_t>(count);
  }
  return total;
}

absl::StatusOr<uint64_t> File::Size() const {
  struct stat info {};
  if (fstat(descriptor_, &info) != 0) {
    return StatusFromErrno(errno, "look at a file");
  }
  return static_cast<uint64_t>(info.st_size);
}

absl::Status File::Truncate(uint64_t size) {
  return ftruncate(descriptor_, static_cast<off_t>(size)) == 0 ? absl::OkStatus()
                                                               : StatusFromErrno(errno, "shorten a file");
}

absl::Status File::Sync() {
  return fsync(descriptor_) == 0 ? absl::OkStatus() : StatusFromErrno(errno, "flush a file");
}

absl::Status SyncFolder(const std::filesystem::path& folder) {
  TESSERA_ASSIGN_OR_RETURN(File file, File::Open(folder, O_RDONLY | O_DIRECTORY));
  return file.Sync();
}

absl::Status RenameDurably(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (rename(from.c_str(), to.c_str()) != 0) {
    return StatusFromErrno(errno, "rename a file");
  }
  TESSERA_RETURN_IF_ERROR(SyncFolder(to.parent_path()));
  return from.parent_path() == to.parent_path() ? absl::OkStatus() : SyncFolder(from.parent_path());
}

}  // namespace tessera
