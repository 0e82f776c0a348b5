// Files that survive a power cut: written, flushed, renamed into place, and the folder flushed too.
//
// Messages name what was being done, never a path.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string_view>
#include <utility>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

// Owns one file descriptor.
class File {
 public:
  File() = default;
  // Takes over `descriptor`.
  explicit File(int descriptor) : descriptor_(descriptor) {}
  File(File&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  File& operator=(File&& other) noexcept;
  ~File();

  // `flags` as for open(2). Errors: NOT_FOUND, storage errors.
  [[nodiscard]] static absl::StatusOr<File> Open(const std::filesystem::path& path, int flags);

  // Writes all of `bytes` at `offset`. Errors: storage errors.
  [[nodiscard]] absl::Status WriteAt(uint64_t offset, std::span<const std::byte> bytes);
  // Reads until `bytes` is full or the file ends; returns the number read.
  [[nodiscard]] absl::StatusOr<size_t> ReadAt(uint64_t offset, std::span<std::byte> bytes) const;
  [[nodiscard]] absl::StatusOr<uint64_t> Size() const;
  [[nodiscard]] absl::Status Truncate(uint64_t size);
  // Returns once the bytes are on the medium.
  [[nodiscard]] absl::Status Sync();

  [[nodiscard]] int descriptor() const { return descriptor_; }

 private:
  int descriptor_ = -1;
};

// Makes the entries of `folder` durable.
[[nodiscard]] absl::Status SyncFolder(const std::filesystem::path& folder);
// Renames and makes the rename durable in both folders. An existing `to` is replaced.
[[nodiscard]] absl::Status RenameDurably(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace tessera
