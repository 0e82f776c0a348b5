#include "btf/base/atomic_file.h"

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <utility>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"

namespace tessera {

AtomicFile::AtomicFile(int descriptor, std::filesystem::path path, std::string temporary)
    : descriptor_(descriptor), path_(std::move(path)), temporary_(std::move(temporary)) {}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)) {}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
    ::unlink(temporary_.c_str());
  }
}

absl::StatusOr<AtomicFile> AtomicFile::Create(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    return FileError(EISDIR, "cannot write", path);
  }
  // Not mkostemp: its files are private, and the umask cannot be read without setting it for every thread.
  static std::atomic<uint64_t> counter = 0;
  for (;;) {
    std::string temporary = absl::StrCat(path.string(), ".", ::getpid(), ".", counter.fetch_add(1), ".tmp");
    const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0) {
      return AtomicFile(descriptor, path, std::move(temporary));
    }
    if (errno != EEXIST) {
      return FileError(errno, "cannot create", path);
    }
  }
}

absl::Status AtomicFile::Write(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) {
        continue;
      }
      return FileError(errno, "cannot write", path_);
    }
    bytes.remove_prefix(static_cast<size_t>(written));
  }
  return absl::OkStatus();
}

absl::Status AtomicFile::Commit() {
  if (::fsync(descriptor_) != 0) {
    return FileError(errno, "cannot write", path_);
  }
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) {
    return FileError(errno, "cannot create", path_);
  }
  ::close(std::exchange(descriptor_, -1));
  return absl::OkStatus();
}

absl::Status WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes) {
  TESSERA_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  TESSERA_RETURN_IF_ERROR(file.Write(bytes));
  return file.Commit();
}

absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    return FileError(errno, "cannot open", path);
  }
  std::string bytes;
  struct stat info = {};
  if (::fstat(descriptor, &info) == 0 && info.st_size > 0) {
    bytes.resize(static_cast<size_t>(info.st_size));
  }
  // The size is a guess (it may be a pipe, or grow): read until the end.
  constexpr size_t kStep = 64 << 10;
  size_t size = 0;
  while (true) {
    if (size == bytes.size()) {
      bytes.resize(size + kStep);
    }
    const ssize_t got = ::read(descriptor, bytes.data() + size, bytes.size() - size);
    if (got < 0 && errno == EINTR) {
      continue;
    }
    if (got < 0) {
      const int error_number = errno;
      ::close(descriptor);
      return FileError(error_number, "cannot read", path);
    }
    if (got == 0) {
      break;
    }
    size += static_cast<size_t>(got);
  }
  ::close(descriptor);
  bytes.resize(size);
  return bytes;
}

}  // namespace tessera
