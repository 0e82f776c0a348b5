// Blobs on the local disk, named by their SHA-256, shared by all processes of a user.
//
//   FOLDER/blobs/ab/ab12..    complete blobs; checked against their name whenever they are read
//   FOLDER/partial/ab12..     what an interrupted download brought, continued by the next one
//
// The cache is an optimisation: whoever uses it goes on without when it cannot be read or written.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

// 4 GiB; the blobs that were not used for longest go first.
inline constexpr uint64_t kCacheLimitBytes = uint64_t{4} << 30;

// Stateless: safe to share between threads and processes.
class BlobCache {
 public:
  // 0: kCacheLimitBytes.
  explicit BlobCache(std::filesystem::path folder, uint64_t limit_bytes = kCacheLimitBytes);

  // The blob, or nothing when it is not here. A file whose bytes do not match its name is removed.
  [[nodiscard]] std::optional<std::string> Read(std::string_view sha256) const;

  // Keeps bytes whose digest the caller has checked, unless they are more than the limit. Errors: those of
  // Begin and Finish.
  [[nodiscard]] absl::Status Put(std::string_view sha256, std::string_view bytes) const;

  // A download in progress, held by one process at a time. Not thread-safe.
  class Partial {
   public:
    Partial(Partial&& other) noexcept;
    Partial& operator=(Partial&&) = delete;
    ~Partial();

    // What an earlier download brought.
    [[nodiscard]] absl::StatusOr<std::string> ReadAll();
    [[nodiscard]] absl::Status Append(std::string_view bytes);
    // Starts again from nothing.
    [[nodiscard]] absl::Status Clear();

   private:
    friend class BlobCache;
    Partial(int descriptor, std::filesystem::path path);
    int descriptor_ = -1;
    std::filesystem::path path_;
  };

  // Errors: ABORTED while another process downloads the same blob, those of the file system otherwise.
  [[nodiscard]] absl::StatusOr<Partial> Begin(std::string_view sha256) const;
  // Makes a partial download, whose digest the caller has checked, a blob of the cache, and drops the oldest
  // blobs beyond the limit.
  [[nodiscard]] absl::Status Finish(Partial partial, std::string_view sha256) const;

 private:
  [[nodiscard]] std::filesystem::path BlobPath(std::string_view sha256) const;
  void DropOldest(const std::filesystem::path& keep) const;

  std::filesystem::path folder_;
  uint64_t limit_bytes_;
};

}  // namespace tessera
