#include "btf/image/byte_stream.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <absl/strings/str_cat.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"

namespace tessera {

namespace {

class MemoryStream : public ByteStream {
 public:
  explicit MemoryStream(std::span<const std::byte> bytes) : bytes_(bytes) {}
  explicit MemoryStream(std::string bytes)
      : owned_(std::move(bytes)), bytes_(std::as_bytes(std::span(owned_.data(), owned_.size()))) {}
  MemoryStream(const MemoryStream&) = delete;
  MemoryStream& operator=(const MemoryStream&) = delete;

  [[nodiscard]] uint64_t size() const override { return bytes_.size(); }
  [[nodiscard]] absl::StatusOr<size_t> Read(std::span<std::byte> bytes) override {
    const size_t count = std::min(bytes.size(), bytes_.size() - position_);
    std::copy_n(bytes_.begin() + static_cast<ptrdiff_t>(position_), count, bytes.begin());
    position_ += count;
    return count;
  }
  [[nodiscard]] bool seekable() const override { return true; }
  [[nodiscard]] absl::Status Seek(uint64_t position) override {
    if (position > bytes_.size()) {
      return absl::InvalidArgumentError(absl::StrCat("position ", position, " of ", bytes_.size(), " bytes"));
    }
    position_ = position;
    return absl::OkStatus();
  }

 private:
  std::string owned_;
  std::span<const std::byte> bytes_;
  size_t position_ = 0;
};

class FileStream : public ByteStream {
 public:
  FileStream(int descriptor, uint64_t size, std::string name)
      : descriptor_(descriptor), size_(size), name_(std::move(name)) {}
  ~FileStream() override { close(descriptor_); }
  FileStream(const FileStream&) = delete;
  FileStream& operator=(const FileStream&) = delete;

  [[nodiscard]] uint64_t size() const override { return size_; }
  [[nodiscard]] absl::StatusOr<size_t> Read(std::span<std::byte> bytes) override {
    size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t count =
          pread(descriptor_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(position_ + done));
      if (count < 0 && errno == EINTR) {
        continue;
      }
      if (count < 0) {
        return FileError(errno, "cannot read", name_);
      }
      if (count == 0) {
        break;
      }
      done += static_cast<size_t>(count);
    }
    position_ += done;
    return done;
  }
  [[nodiscard]] bool seekable() const override { return true; }
  [[nodiscard]] absl::Status Seek(uint64_t position) override {
    if (position > size_) {
      return absl::InvalidArgumentError(
          absl::StrCat(name_, ": position ", position, " of ", size_, " bytes"));
    }
    position_ = position;
    return absl::OkStatus();
  }

 private:
  int descriptor_;
  uint64_t size_;
  std::string name_;
  uint64_t position_ = 0;
};

}  // namespace

std::unique_ptr<ByteStream> MakeMemoryStream(std::span<const std::byte> bytes) {
  return std::make_unique<MemoryStream>(bytes);
}

std::unique_ptr<ByteStream> MakeMemoryStream(std::string bytes) {
  return std::make_unique<MemoryStream>(std::move(bytes));
}

absl::StatusOr<std::unique_ptr<ByteStream>> OpenFileStream(const std::filesystem::path& path) {
  // Not blocking, so that a pipe of that name cannot hold us up before it is refused.
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (descriptor < 0) {
    return FileError(errno, "cannot open", path.string());
  }
  struct stat status {};
  if (fstat(descriptor, &status) != 0) {
    const int error = errno;
    close(descriptor);
    return FileError(error, "cannot open", path.string());
  }
  if (!S_ISREG(status.st_mode)) {
    close(descriptor);
    return absl::InvalidArgumentError(absl::StrCat(path.string(), ": not a regular file"));
  }
  return std::make_unique<FileStream>(descriptor, static_cast<uint64_t>(status.st_size), path.string());
}

absl::StatusOr<std::string> ReadAll(ByteStream& stream, uint64_t limit_bytes) {
  // The size may be a claim of an archive's: grow with what is really there.
  constexpr size_t kStep = size_t{1} << 20;
  std::string bytes;
  if (stream.size() > limit_bytes) {
    return absl::ResourceExhaustedError(
        absl::StrCat(stream.size(), " bytes, more than the limit of ", limit_bytes));
  }
  bytes.reserve(std::min<uint64_t>(stream.size(), kStep));
  for (;;) {
    const size_t old_size = bytes.size();
    bytes.resize(old_size + kStep);
    TESSERA_ASSIGN_OR_RETURN(const size_t count,
                             stream.Read(std::as_writable_bytes(std::span(bytes.data() + old_size, kStep))));
    bytes.resize(old_size + count);
    if (bytes.size() > limit_bytes) {
      return absl::ResourceExhaustedError(absl::StrCat("more than the limit of ", limit_bytes, " bytes"));
    }
    if (count < kStep) {
      return bytes;
    }
  }
}

}  // namespace tessera
