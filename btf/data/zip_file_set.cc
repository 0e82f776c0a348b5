#include <algorithm>
#include <array>
#include <mutex>
#include <utility>

#include <absl/strings/str_cat.h>
#include <zip.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"
#include "btf/data/file_set.h"

namespace tessera {

namespace {

struct ZipDeleter {
  void operator()(zip_t* zip) const { zip_discard(zip); }
};
using ZipHandle = std::unique_ptr<zip_t, ZipDeleter>;

absl::StatusOr<ZipHandle> OpenHandle(const std::filesystem::path& path) {
  int code = 0;
  ZipHandle handle(zip_open(path.c_str(), ZIP_RDONLY, &code));
  if (handle != nullptr) {
    return handle;
  }
  zip_error_t error;
  zip_error_init_with_code(&error, code);
  const std::string message =
      absl::StrCat(path.string(), ": not a readable zip archive: ", zip_error_strerror(&error));
  const int system_error = zip_error_code_system(&error);
  zip_error_fini(&error);
  switch (code) {
    case ZIP_ER_OPEN:
    case ZIP_ER_READ:
      return FileError(system_error, "cannot open", path.string());
    case ZIP_ER_NOENT:
      return absl::NotFoundError(message);
    default:
      return absl::InvalidArgumentError(message);
  }
}

class ZipFileSet : public FileSet {
 public:
  ZipFileSet(std::filesystem::path path, ZipHandle handle) : path_(std::move(path)) {
    idle_.push_back(std::move(handle));
  }

  absl::Status ReadDirectory() {
    zip_t* const zip = idle_.front().get();
    const auto num_entries = static_cast<uint64_t>(zip_get_num_entries(zip, 0));
    if (num_entries > kMaxFiles) {
      return absl::ResourceExhaustedError(
          absl::StrCat(path_.string(), ": ", num_entries, " entries, the limit is ", kMaxFiles));
    }
    ErrorList faults;
    std::vector<std::pair<FileEntry, uint64_t>> entries;
    uint64_t total_bytes = 0;
    uint64_t packed_bytes = 0;
    for (uint64_t i = 0; i < num_entries; ++i) {
      zip_stat_t stat;
      if (zip_stat_index(zip, i, 0, &stat) != 0 ||
          (~stat.valid & (ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE | ZIP_STAT_COMP_METHOD)) != 0) {
        return absl::DataLossError(absl::StrCat(path_.string(), ": entry ", i, " is damaged"));
      }
      std::string name = stat.name;
      std::replace(name.begin(), name.end(), '\\', '/');
      if (!IsInnerName(name)) {
        faults.Add(absl::StrCat("'", name, "' leaves the archive"));
        continue;
      }
      if (name.ends_with('/') || IsHiddenName(name)) {
        continue;
      }
      if (stat.comp_method != ZIP_CM_STORE && stat.comp_method != ZIP_CM_DEFLATE) {
        faults.Add(absl::StrCat("'", name, "' has compression method ", stat.comp_method,
                                ", only stored and deflated are read"));
      }
      if ((stat.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && stat.encryption_method != ZIP_EM_NONE) {
        faults.Add(absl::StrCat("'", name, "' is encrypted"));
      }
      if (stat.size > kRatioFreeBytes && stat.size / kMaxArchiveRatio > stat.comp_size) {
        return absl::ResourceExhaustedError(
            absl::StrCat(path_.string(), ": '", name, "' unpacks from ", stat.comp_size, " to ", stat.size,
                         " bytes, the limit is ", kMaxArchiveRatio, " times"));
      }
      if (stat.size > kMaxArchiveBytes - total_bytes) {
        return absl::ResourceExhaustedError(
            absl::StrCat(path_.string(), ": unpacks to more than the limit of ", kMaxArchiveBytes, " bytes"));
      }
      total_bytes += stat.size;
      packed_bytes += std::min<uint64_t>(stat.comp_size, kMaxArchiveBytes);
      entries.push_back({{std::move(name), stat.size, stat.comp_method == ZIP_CM_STORE}, i});
    }
    if (total_bytes > 64 * kRatioFreeBytes && total_bytes / kMaxArchiveRatio > packed_bytes) {
      return absl::ResourceExhaustedError(absl::StrCat(path_.string(), ": unpacks from ", packed_bytes,
                                                       " to ", total_bytes, " bytes, the limit is ",
                                                       kMaxArchiveRatio, " times"));
    }
    std::sort(entries.begin(), entries.end(),
              [](const auto& a, const auto& b) { return a.first.name < b.first.name; });
    for (auto& [file, index] : entries) {
      if (!files_.empty() && files_.back().name == file.name) {
        faults.Add(absl::StrCat("'", file.name, "' is there twice"));
      }
      files_.push_back(std::move(file));
      indices_.push_back(index);
    }
    if (!faults.empty()) {
      return absl::InvalidArgumentError(absl::StrCat(path_.string(), ": ", faults.count(), " of ",
                                                     num_entries, " entries refused: ", faults.Text()));
    }
    return absl::OkStatus();
  }

  [[nodiscard]] absl::StatusOr<std::unique_ptr<ByteStream>> Open(size_t index) const override;

  // libzip handles are not thread-safe: each stream has one of its own while it lives.
  [[nodiscard]] absl::StatusOr<ZipHandle> TakeHandle() const {
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        ZipHandle handle = std::move(idle_.back());
        idle_.pop_back();
        return handle;
      }
    }
    return OpenHandle(path_);
  }
  void GiveHandle(ZipHandle handle) const {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(handle));
  }

 private:
  static bool IsHiddenName(const std::string& name) {
    return name.starts_with(".") || name.starts_with("__MACOSX/") || name.find("/.") != std::string::npos;
  }

  std::filesystem::path path_;
  std::vector<uint64_t> indices_;  // in the archive, of files_
  mutable std::mutex mutex_;
  mutable std::vector<ZipHandle> idle_;  // guarded by mutex_
};

class ZipStream : public ByteStream {
 public:
  ZipStream(const ZipFileSet& set, const FileEntry& entry, ZipHandle handle, zip_file_t* file)
      : set_(set), entry_(entry), handle_(std::move(handle)), file_(file) {}
  ~ZipStream() override {
    zip_fclose(file_);
    set_.GiveHandle(std::move(handle_));
  }
  ZipStream(const ZipStream&) = delete;
  ZipStream& operator=(const ZipStream&) = delete;

  [[nodiscard]] uint64_t size() const override { return entry_.size_bytes; }
  [[nodiscard]] absl::StatusOr<size_t> Read(std::span<std::byte> bytes) override {
    size_t done = 0;
    while (done < bytes.size()) {
      const zip_int64_t count = zip_fread(file_, bytes.data() + done, bytes.size() - done);
      if (count < 0) {
        return absl::DataLossError(
            absl::StrCat("damaged in the archive: ", zip_error_strerror(zip_file_get_error(file_))));
      }
      if (count == 0) {
        break;
      }
      done += static_cast<size_t>(count);
    }
    return done;
  }
  // libzip checks the sum when it has seen every byte, which seeking may have prevented.
  [[nodiscard]] absl::Status Finish() override {
    std::array<std::byte, 4096> rest;
    for (;;) {
      TESSERA_ASSIGN_OR_RETURN(const size_t count, Read(rest));
      if (count < rest.size()) {
        return absl::OkStatus();
      }
    }
  }
  [[nodiscard]] bool seekable() const override { return entry_.seekable; }
  [[nodiscard]] absl::Status Seek(uint64_t position) override {
    if (zip_fseek(file_, static_cast<zip_int64_t>(position), SEEK_SET) != 0) {
      return absl::InvalidArgumentError(absl::StrCat("position ", position, " of ", size(), " bytes"));
    }
    return absl::OkStatus();
  }

 private:
  const ZipFileSet& set_;
  const FileEntry& entry_;
  ZipHandle handle_;
  zip_file_t* file_;
};

absl::StatusOr<std::unique_ptr<ByteStream>> ZipFileSet::Open(size_t index) const {
  TESSERA_ASSIGN_OR_RETURN(ZipHandle handle, TakeHandle());
  zip_file_t* const file = zip_fopen_index(handle.get(), indices_[index], 0);
  if (file == nullptr) {
    const absl::Status status = absl::DataLossError(
        absl::StrCat(files_[index].name, ": damaged in the archive: ", zip_strerror(handle.get())));
    GiveHandle(std::move(handle));
    return status;
  }
  return std::make_unique<ZipStream>(*this, files_[index], std::move(handle), file);
}

}  // namespace

absl::StatusOr<std::unique_ptr<FileSet>> OpenZip(const std::filesystem::path& path) {
  TESSERA_ASSIGN_OR_RETURN(ZipHandle handle, OpenHandle(path));
  auto set = std::make_unique<ZipFileSet>(path, std::move(handle));
  TESSERA_RETURN_IF_ERROR(set->ReadDirectory());
  return set;
}

}  // namespace tessera
