#include <atomic>
#include <cerrno>
#include <cstdint>
#include <string>

#include <fcntl.h>
#include <unistd.h>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/byte_stream.h"
#include "btf/image/image_io.h"

namespace tessera {

namespace {

absl::Status WriteAndSync(int descriptor, std::string_view bytes, const std::string& name) {
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count < 0) {
      return FileError(errno, "cannot write", name);
    }
    bytes.remove_prefix(static_cast<size_t>(count));
  }
  return fsync(descriptor) == 0 ? absl::OkStatus() : FileError(errno, "cannot write", name);
}

// A new file beside `name`, created with the mode that the user's umask gives; sets `temporary`. -1 and errno
// on failure.
int CreateTemporary(const std::string& name, std::string& temporary) {
  static std::atomic<uint64_t> counter = 0;
  for (;;) {
    temporary = absl::StrCat(name, ".", getpid(), ".", counter.fetch_add(1), ".tmp");
    const int descriptor = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0 || errno != EEXIST) {
      return descriptor;
    }
  }
}

}  // namespace

absl::Status WriteFile(const std::filesystem::path& path, std::string_view bytes) {
  const std::string name = path.string();
  std::string temporary;
  const int descriptor = CreateTemporary(name, temporary);
  if (descriptor < 0) {
    return FileError(errno, "cannot create", name);
  }
  absl::Status status = WriteAndSync(descriptor, bytes, name);
  if (close(descriptor) != 0 && status.ok()) {
    status = FileError(errno, "cannot write", name);
  }
  if (status.ok() && rename(temporary.c_str(), name.c_str()) != 0) {
    status = FileError(errno, "cannot create", name);
  }
  if (!status.ok()) {
    unlink(temporary.c_str());
  }
  return status;
}

}  // namespace tessera
