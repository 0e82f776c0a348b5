// A file that is either complete or not there: written beside its place and renamed at the end.
//
//   TESSERA_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
//   TESSERA_RETURN_IF_ERROR(file.Write(bytes));
//   TESSERA_RETURN_IF_ERROR(file.Commit());
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

// Without Commit() nothing is left behind. Not thread-safe.
class AtomicFile {
 public:
  // Errors of this and the other calls are FileError's: NOT_FOUND (no such folder), PERMISSION_DENIED,
  // INVALID_ARGUMENT (a folder of that name), RESOURCE_EXHAUSTED (full disk), INTERNAL.
  [[nodiscard]] static absl::StatusOr<AtomicFile> Create(const std::filesystem::path& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  [[nodiscard]] absl::Status Write(std::string_view bytes);
  // The bytes are on the medium and the file has its name. Replaces a file of that name.
  [[nodiscard]] absl::Status Commit();

 private:
  AtomicFile(int descriptor, std::filesystem::path path, std::string temporary);

  int descriptor_ = -1;
  std::filesystem::path path_;
  std::string temporary_;
};

// The three calls above in one.
[[nodiscard]] absl::Status WriteFileAtomically(const std::filesystem::path& path, std::string_view bytes);

// A whole file. Errors: NOT_FOUND, PERMISSION_DENIED, INVALID_ARGUMENT (a folder), INTERNAL, naming the path.
[[nodiscard]] absl::StatusOr<std::string> ReadWholeFile(const std::filesystem::path& path);

}  // namespace tessera
