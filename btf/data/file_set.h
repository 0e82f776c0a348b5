// The files of a folder or a zip archive by name, read as streams. Archives are never unpacked to disk.
//
//   TESSERA_ASSIGN_OR_RETURN(auto files, OpenZip("WOOL128.zip"));
//   TESSERA_ASSIGN_OR_RETURN(auto stream, files->Open(0));
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/image/byte_stream.h"

namespace tessera {

struct FileEntry {
  std::string name;  // relative, '/' between folders
  uint64_t size_bytes = 0;
  bool seekable = true;  // false: compressed, read from the front only
};

// Immutable, so safe to share between threads.
class FileSet {
 public:
  virtual ~FileSet() = default;

  // In order of name.
  [[nodiscard]] std::span<const FileEntry> files() const { return files_; }
  [[nodiscard]] std::optional<size_t> Find(std::string_view name) const;
  // Thread-safe. The stream must not outlive the set. Errors: those of opening a file, DATA_LOSS (damaged
  // archive).
  [[nodiscard]] virtual absl::StatusOr<std::unique_ptr<ByteStream>> Open(size_t index) const = 0;

 protected:
  std::vector<FileEntry> files_;
};

// What an archive or a folder may hold; beyond that it is refused before anything is read.
inline constexpr uint64_t kMaxFiles = 200'000;
inline constexpr int kMaxFolderDepth = 8;
inline constexpr uint64_t kMaxArchiveBytes = uint64_t{256} << 30;  // unpacked
// Unpacked to packed, for each file above kRatioFreeBytes and for the whole. Images barely compress.
inline constexpr uint64_t kMaxArchiveRatio = 200;
inline constexpr uint64_t kRatioFreeBytes = uint64_t{1} << 20;

// Every regular file below `folder`; hidden ones (".x", "__MACOSX") are left out.
// Errors: NOT_FOUND, PERMISSION_DENIED, RESOURCE_EXHAUSTED (limits above).
[[nodiscard]] absl::StatusOr<std::unique_ptr<FileSet>> OpenFolder(const std::filesystem::path& folder);
// The files of these names below `folder`, no others. Errors: INVALID_ARGUMENT naming those that are missing.
[[nodiscard]] absl::StatusOr<std::unique_ptr<FileSet>> OpenFiles(const std::filesystem::path& folder,
                                                                 std::vector<std::string> names);
// Every file of an archive, stored or deflated. Errors: INVALID_ARGUMENT (not a zip, encrypted, another
// compression, names that leave the archive, duplicate names), RESOURCE_EXHAUSTED (limits above), as above.
[[nodiscard]] absl::StatusOr<std::unique_ptr<FileSet>> OpenZip(const std::filesystem::path& path);

// Whether `name` is relative and stays below its folder: no "..", no leading '/', no drive, no backslash.
[[nodiscard]] bool IsInnerName(std::string_view name);

}  // namespace tessera
