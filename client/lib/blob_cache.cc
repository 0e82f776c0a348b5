#include "client/lib/blob_cache.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include "btf/base/atomic_file.h"
#include "btf/base/file_error.h"
#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace fs = std::filesystem;

namespace {

constexpr size_t kDigestDigits = 64;

// A digest becomes a file name: nothing else may.
bool IsDigest(std::string_view text) {
  return text.size() == kDigestDigits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

}  // namespace

BlobCache::BlobCache(fs::path folder, uint64_t limit_bytes)
    : folder_(std::move(folder)), limit_bytes_(limit_bytes == 0 ? kCacheLimitBytes : limit_bytes) {}

fs::path BlobCache::BlobPath(std::string_view sha256) const {
  return folder_ / "blobs" / sha256.substr(0, 2) / sha256;
}

std::optional<std::string> BlobCache::Read(std::string_view sha256) const {
  if (!IsDigest(sha256)) {
    return std::nullopt;
  }
  const fs::path path = BlobPath(sha256);
  absl::StatusOr<std::string> bytes = ReadWholeFile(path);
  if (!bytes.ok()) {
    return std::nullopt;
  }
  std::error_code ignored;
  if (Sha256Hex(std::as_bytes(std::span(*bytes))) != sha256) {
    fs::remove(path, ignored);
    return std::nullopt;
  }
  fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);  // used just now, see DropOldest
  return *std::move(bytes);
}

absl::Status BlobCache::Put(std::string_view sha256, std::string_view bytes) const {
  if (bytes.size() > limit_bytes_) {
    return absl::OkStatus();
  }
  TESSERA_ASSIGN_OR_RETURN(Partial partial, Begin(sha256));
  TESSERA_RETURN_IF_ERROR(partial.Clear());
  TESSERA_RETURN_IF_ERROR(partial.Append(bytes));
  return Finish(std::move(partial), sha256);
}

BlobCache::Partial::Partial(int descriptor, fs::path path)
    : descriptor_(descriptor), path_(std::move(path)) {}

BlobCache::Partial::Partial(Partial&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), path_(std::move(other.path_)) {}

BlobCache::Partial::~Partial() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);  // releases the lock
  }
}

absl::StatusOr<std::string> BlobCache::Partial::ReadAll() {
  return ReadWholeFile(path_);
}

absl::Status BlobCache::Partial::Append(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno != EINTR) {
      return FileError(errno, "cannot write", path_);
    }
    bytes.remove_prefix(written < 0 ? 0 : static_cast<size_t>(written));
  }
  return absl::OkStatus();
}

absl::Status BlobCache::Partial::Clear() {
  if (::ftruncate(descriptor_, 0) != 0) {
    return FileError(errno, "cannot truncate", path_);
  }
  return absl::OkStatus();
}

absl::StatusOr<BlobCache::Partial> BlobCache::Begin(std::string_view sha256) const {
  if (!IsDigest(sha256)) {
    return absl::InvalidArgumentError(absl::StrCat("digest \"",
                                                   absl::string_view(sha256.data(), sha256.size()),
                                                   "\": expected 64 lower-case hexadecimal digits"));
  }
  const fs::path path = folder_ / "partial" / sha256;
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (error) {
    return FileError(error.value(), "cannot create", path.parent_path());
  }
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (descriptor < 0) {
    return FileError(errno, "cannot open", path);
  }
  Partial partial(descriptor, path);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    return absl::AbortedError(absl::StrCat(path.string(), ": another process is writing it"));
  }
  return partial;
}

absl::Status BlobCache::Finish(Partial partial, std::string_view sha256) const {
  const fs::path path = BlobPath(sha256);
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  if (!error) {
    fs::rename(partial.path_, path, error);
  }
  if (error) {
    return FileError(error.value(), "cannot create", path);
  }
  DropOldest(path);
  return absl::OkStatus();
}

void BlobCache::DropOldest(const fs::path& keep) const {
  struct Entry {
    fs::file_time_type used;
    uint64_t size;
    fs::path path;
  };
  std::vector<Entry> entries;
  uint64_t total = 0;
  std::error_code error;
  for (fs::recursive_directory_iterator it(folder_ / "blobs", error), end; !error && it != end;
       it.increment(error)) {
    std::error_code gone;  // another process may remove files meanwhile
    if (!it->is_regular_file(gone) || gone) {
      continue;
    }
    Entry entry{it->last_write_time(gone), it->file_size(gone), it->path()};
    if (!gone) {
      total += entry.size;
      entries.push_back(std::move(entry));
    }
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.used < b.used; });
  for (const Entry& entry : entries) {
    if (total <= limit_bytes_) {
      break;
    }
    if (entry.path != keep && fs::remove(entry.path, error)) {
      total -= entry.size;
    }
  }
}

}  // namespace tessera
