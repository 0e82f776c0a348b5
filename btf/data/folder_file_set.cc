#include <algorithm>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"
#include "btf/data/file_set.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

class FolderFileSet : public FileSet {
 public:
  FolderFileSet(fs::path folder, std::vector<FileEntry> files) : folder_(std::move(folder)) {
    files_ = std::move(files);
    std::sort(files_.begin(), files_.end(),
              [](const FileEntry& a, const FileEntry& b) { return a.name < b.name; });
  }

  [[nodiscard]] absl::StatusOr<std::unique_ptr<ByteStream>> Open(size_t index) const override {
    return OpenFileStream(folder_ / files_[index].name);
  }

 private:
  fs::path folder_;
};

bool IsHidden(const std::string& component) {
  return component.starts_with(".") || component == "__MACOSX";
}

}  // namespace

std::optional<size_t> FileSet::Find(std::string_view name) const {
  const auto found =
      std::lower_bound(files_.begin(), files_.end(), name,
                       [](const FileEntry& file, std::string_view wanted) { return file.name < wanted; });
  if (found == files_.end() || found->name != name) {
    return std::nullopt;
  }
  return static_cast<size_t>(found - files_.begin());
}

absl::StatusOr<std::unique_ptr<FileSet>> OpenFolder(const fs::path& folder) {
  std::vector<FileEntry> files;
  std::error_code error;
  fs::recursive_directory_iterator walk(folder, error);
  for (; !error && walk != fs::recursive_directory_iterator(); walk.increment(error)) {
    std::error_code ignored;
    if (IsHidden(walk->path().filename().string())) {
      walk.disable_recursion_pending();
      continue;
    }
    if (walk->is_directory(ignored)) {
      if (walk.depth() + 1 >= kMaxFolderDepth) {
        return absl::ResourceExhaustedError(
            absl::StrCat(walk->path().string(), ": more than ", kMaxFolderDepth, " folders deep"));
      }
      continue;
    }
    if (walk->is_regular_file(ignored)) {
      files.push_back({walk->path().lexically_relative(folder).generic_string(), walk->file_size(ignored)});
      if (files.size() > kMaxFiles) {
        return absl::ResourceExhaustedError(
            absl::StrCat(folder.string(), ": more than ", kMaxFiles, " files"));
      }
    }
  }
  if (error) {
    return FileError(error.value(), "cannot read folder", folder.string());
  }
  return std::make_unique<FolderFileSet>(folder, std::move(files));
}

absl::StatusOr<std::unique_ptr<FileSet>> OpenFiles(const fs::path& folder, std::vector<std::string> names) {
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  std::vector<FileEntry> files;
  ErrorList missing;
  for (std::string& name : names) {
    std::error_code error;
    const uint64_t size = fs::file_size(folder / name, error);
    if (error) {
      missing.Add(std::move(name));
    } else {
      files.push_back({std::move(name), size});
    }
  }
  if (!missing.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        missing.count(), " of ", names.size(), " files missing in ", folder.string(), ": ", missing.Text()));
  }
  return std::make_unique<FolderFileSet>(folder, std::move(files));
}

bool IsInnerName(std::string_view name) {
  if (name.empty() || name.front() == '/' || name.find('\\') != std::string_view::npos ||
      name.find('\0') != std::string_view::npos || (name.size() > 1 && name[1] == ':')) {
    return false;
  }
  size_t begin = 0;
  while (begin <= name.size()) {
    const size_t end = std::min(name.find('/', begin), name.size());
    if (name.substr(begin, end - begin) == "..") {
      return false;
    }
    begin = end + 1;
  }
  return true;
}

}  // namespace tessera
