#include "server/catalog/blob_store.h"

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <vector>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/catalog/storage_error.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

// Left free for the catalog itself when an upload is declared.
constexpr uint64_t kReserveBytes = 16 << 20;

std::span<const std::byte> AsBytes(std::string_view text) {
  return std::as_bytes(std::span(text));
}

absl::Status Missing(std::string_view sha256) {
  return WithReason(absl::NotFoundError(absl::StrCat("the server has no blob ", std::string(sha256))),
                    "BLOB_MISSING", sha256);
}

absl::Status StatusFromCode(const std::error_code& error, std::string_view action) {
  return error ? StatusFromErrno(error.value(), action) : absl::OkStatus();
}

absl::Status InsertBlobRow(Database& db, const std::string& sha256, uint64_t size_bytes,
                           const std::optional<std::string>& inline_bytes, int64_t now_ms) {
  std::optional<BlobBytes> data;
  if (inline_bytes) {
    data = BlobBytes{*inline_bytes};
  }
  return db.Run(
      "INSERT INTO blobs (sha256, size_bytes, data, touch_ms) VALUES (?, ?, ?, ?)"
      " ON CONFLICT (sha256) DO UPDATE SET touch_ms = excluded.touch_ms",
      sha256, size_bytes, data, now_ms);
}

}  // namespace

BlobHandle::BlobHandle(std::string inline_bytes)
    : inline_bytes_(std::move(inline_bytes)), size_bytes_(inline_bytes_.size()) {}

absl::Status BlobHandle::ReadAt(uint64_t offset, std::span<std::byte> bytes) const {
  if (offset > size_bytes_ || bytes.size() > size_bytes_ - offset) {
    return absl::OutOfRangeError(
        absl::StrCat("offset ", offset, " is beyond the blob's end at ", size_bytes_));
  }
  if (file_.descriptor() < 0) {
    const auto source = AsBytes(inline_bytes_).subspan(offset, bytes.size());
    std::copy(source.begin(), source.end(), bytes.begin());
    return absl::OkStatus();
  }
  TESSERA_ASSIGN_OR_RETURN(const size_t count, file_.ReadAt(offset, bytes));
  return count == bytes.size()
             ? absl::OkStatus()
             : WithReason(absl::DataLossError("a stored file is too short"), "BLOB_CORRUPT");
}

absl::Status StagedBlob::InsertRow(Database& db, int64_t now_ms) const {
  return InsertBlobRow(db, sha256_, size_bytes_, inline_bytes_, now_ms);
}

BlobStore::BlobStore(const fs::path& folder, Connections& connections, Clock clock, uint64_t max_upload_bytes)
    : blobs_folder_(folder / "blobs"),
      uploads_folder_(folder / "uploads"),
      scratch_folder_(folder / "scratch"),
      connections_(connections),
      clock_(std::move(clock)),
      max_upload_bytes_(max_upload_bytes) {}

absl::StatusOr<std::unique_ptr<BlobStore>> BlobStore::Open(const fs::path& folder, Connections& connections,
                                                           Clock clock, uint64_t max_upload_bytes) {
  std::unique_ptr<BlobStore> store(new BlobStore(folder, connections, std::move(clock), max_upload_bytes));
  TESSERA_RETURN_IF_ERROR(store->CreateFolders());
  TESSERA_RETURN_IF_ERROR(store->Sweep());
  return store;
}

absl::Status BlobStore::CreateFolders() const {
  for (const fs::path& folder : {blobs_folder_, uploads_folder_, scratch_folder_}) {
    std::error_code error;
    fs::create_directories(folder, error);
    TESSERA_RETURN_IF_ERROR(StatusFromCode(error, "create the store's folders"));
  }
  return SyncFolder(blobs_folder_.parent_path());
}

absl::Status BlobStore::Sweep() {
  // A finished upload whose row was not written yet goes back to where it came from.
  TESSERA_RETURN_IF_ERROR(connections_.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(Statement uploads, db.Query("SELECT sha256 FROM uploads"));
    for (;;) {
      TESSERA_ASSIGN_OR_RETURN(const bool more, uploads.Step());
      if (!more) {
        return absl::OkStatus();
      }
      if (std::error_code error; fs::exists(blobs_folder_ / uploads.Text(0), error)) {
        TESSERA_RETURN_IF_ERROR(
            RenameDurably(blobs_folder_ / uploads.Text(0), uploads_folder_ / uploads.Text(0)));
      }
    }
  }));
  const auto remove_strays = [this](const fs::path& folder, std::string_view sql) {
    return connections_.Read([&](Database& db) -> absl::Status {
      std::error_code error;
      for (fs::directory_iterator file(folder, error), end; !error && file != end; file.increment(error)) {
        TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query(sql, file->path().filename().string()));
        TESSERA_ASSIGN_OR_RETURN(const bool known, row.Step());
        if (!known) {
          std::error_code ignored;  // what cannot be removed now is tried again at the next start
          fs::remove_all(file->path(), ignored);
        }
      }
      return StatusFromCode(error, "list the store's folders");
    });
  };
  TESSERA_RETURN_IF_ERROR(
      remove_strays(blobs_folder_, "SELECT 1 FROM blobs WHERE sha256 = ? AND data IS NULL"));
  TESSERA_RETURN_IF_ERROR(remove_strays(uploads_folder_, "SELECT 1 FROM uploads WHERE sha256 = ?"));
  return remove_strays(scratch_folder_, "SELECT 1 WHERE ? IS NULL");
}

absl::Status BlobStore::CheckSpace(uint64_t needed_bytes) const {
  struct statvfs info {};
  if (statvfs(blobs_folder_.c_str(), &info) != 0) {
    return StatusFromErrno(errno, "look at the free space");
  }
  const uint64_t free_bytes = uint64_t{info.f_bavail} * info.f_frsize;
  if (free_bytes < needed_bytes || free_bytes - needed_bytes < kReserveBytes) {
    return WithReason(absl::ResourceExhaustedError(absl::StrCat(
                          "the server's data folder has ", free_bytes, " bytes left, the upload needs ",
                          needed_bytes, " and ", kReserveBytes, " stay reserved")),
                      "STORAGE_FULL");
  }
  return absl::OkStatus();
}

absl::StatusOr<StagedBlob> BlobStore::Stage(std::string_view bytes) {
  StagedBlob staged;
  staged.keep_ = std::shared_lock(collect_mutex_);
  staged.sha256_ = Sha256Hex(AsBytes(bytes));
  staged.size_bytes_ = bytes.size();
  if (bytes.size() <= kMaxInlineBytes) {
    staged.inline_bytes_ = std::string(bytes);
    return staged;
  }
  TESSERA_ASSIGN_OR_RETURN(const bool exists, Exists(staged.sha256_));
  if (exists) {
    return staged;
  }
  fs::path temporary;
  {
    const std::lock_guard lock(names_mutex_);
    temporary = blobs_folder_ / absl::StrCat("new-", next_name_++);
  }
  absl::Status status = [&]() -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(File file, File::Open(temporary, O_WRONLY | O_CREAT | O_TRUNC));
    TESSERA_RETURN_IF_ERROR(file.WriteAt(0, AsBytes(bytes)));
    TESSERA_RETURN_IF_ERROR(file.Sync());
    return RenameDurably(temporary, blobs_folder_ / staged.sha256_);
  }();
  if (!status.ok()) {
    unlink(temporary.c_str());
    return status;
  }
  return staged;
}

absl::StatusOr<std::string> BlobStore::Put(std::string_view bytes) {
  TESSERA_ASSIGN_OR_RETURN(StagedBlob staged, Stage(bytes));
  TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) { return staged.InsertRow(db, clock_()); }));
  return staged.sha256();
}

absl::StatusOr<bool> BlobStore::Exists(const std::string& sha256) {
  bool exists = false;
  TESSERA_RETURN_IF_ERROR(connections_.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(Statement row, db.Query("SELECT 1 FROM blobs WHERE sha256 = ?", sha256));
    TESSERA_ASSIGN_OR_RETURN(exists, row.Step());
    return absl::OkStatus();
  }));
  return exists;
}

absl::StatusOr<std::shared_ptr<const BlobHandle>> BlobStore::Get(std::string_view sha256) {
  std::shared_ptr<const BlobHandle> handle;
  TESSERA_RETURN_IF_ERROR(connections_.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(Statement row,
                             db.Query("SELECT size_bytes, data FROM blobs WHERE sha256 = ?", sha256));
    TESSERA_ASSIGN_OR_RETURN(const bool exists, row.Step());
    if (!exists) {
      return Missing(sha256);
    }
    if (!row.IsNull(1)) {
      handle = std::make_shared<const BlobHandle>(row.Text(1));
      return absl::OkStatus();
    }
    const auto size_bytes = static_cast<uint64_t>(row.Int(0));
    absl::StatusOr<File> file = File::Open(blobs_folder_ / std::string(sha256), O_RDONLY);
    if (file.ok()) {
      TESSERA_ASSIGN_OR_RETURN(const uint64_t file_bytes, file->Size());
      if (file_bytes == size_bytes) {
        handle = std::make_shared<const BlobHandle>(*std::move(file), size_bytes);
        return absl::OkStatus();
      }
    } else if (file.status().code() != absl::StatusCode::kNotFound) {
      return file.status();
    }
    return WithReason(absl::DataLossError(absl::StrCat("blob ", std::string(sha256), ": its file of ",
                                                       size_bytes, " bytes is missing or has another size")),
                      "BLOB_CORRUPT", sha256);
  }));
  return handle;
}

absl::StatusOr<std::string> BlobStore::ReadAll(std::string_view sha256, uint64_t limit_bytes) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const BlobHandle> handle, Get(sha256));
  if (handle->size_bytes() > limit_bytes) {
    return absl::ResourceExhaustedError(absl::StrCat("blob ", std::string(sha256), " has ",
                                                     handle->size_bytes(), " bytes, at most ", limit_bytes,
                                                     " are taken here"));
  }
  std::string bytes(handle->size_bytes(), '\0');
  TESSERA_RETURN_IF_ERROR(handle->ReadAt(0, std::as_writable_bytes(std::span(bytes))));
  return bytes;
}

absl::Status BlobStore::CollectGarbage() {
  const std::unique_lock lock(collect_mutex_);
  const int64_t cutoff_ms = clock_() - kUnnamedBlobKeptMs;
  std::vector<std::string> files;
  std::vector<std::string> uploads;
  TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) -> absl::Status {
    // typeof, because SQLite 3.40 answers 0 to IS NULL in the RETURNING clause of a DELETE.
    TESSERA_ASSIGN_OR_RETURN(
        Statement blobs,
        db.Query("DELETE FROM blobs WHERE touch_ms < ?"
                 " AND NOT EXISTS (SELECT 1 FROM materials WHERE blob_sha256 = blobs.sha256)"
                 " AND NOT EXISTS (SELECT 1 FROM tile_sets WHERE blob_sha256 = blobs.sha256)"
                 " AND NOT EXISTS (SELECT 1 FROM tile_sets WHERE thumbnail_sha256 = blobs.sha256)"
                 " AND NOT EXISTS (SELECT 1 FROM job_inputs WHERE job_inputs.sha256 = blobs.sha256)"
                 " RETURNING sha256, typeof(data) = 'null'",
                 cutoff_ms));
    for (;;) {
      TESSERA_ASSIGN_OR_RETURN(const bool more, blobs.Step());
      if (!more) {
        break;
      }
      if (blobs.Int(1) != 0) {
        files.push_back(blobs.Text(0));
      }
    }
    TESSERA_ASSIGN_OR_RETURN(Statement old_uploads,
                             db.Query("DELETE FROM uploads WHERE touch_ms < ? RETURNING sha256", cutoff_ms));
    for (;;) {
      TESSERA_ASSIGN_OR_RETURN(const bool more, old_uploads.Step());
      if (!more) {
        return absl::OkStatus();
      }
      uploads.push_back(old_uploads.Text(0));
    }
  }));
  for (const std::string& sha256 : files) {
    unlink((blobs_folder_ / sha256).c_str());
  }
  for (const std::string& sha256 : uploads) {
    ForgetUpload(sha256);
    unlink((uploads_folder_ / sha256).c_str());
  }
  return absl::OkStatus();
}

BlobStore::Scratch::~Scratch() {
  std::error_code ignored;  // swept at the next start
  fs::remove_all(folder_, ignored);
}

absl::StatusOr<std::unique_ptr<BlobStore::Scratch>> BlobStore::MakeScratch() {
  fs::path folder;
  {
    const std::lock_guard lock(names_mutex_);
    folder = scratch_folder_ / std::to_string(next_name_++);
  }
  std::error_code error;
  fs::create_directories(folder, error);
  TESSERA_RETURN_IF_ERROR(StatusFromCode(error, "create a scratch folder"));
  return std::make_unique<Scratch>(folder);
}

}  // namespace tessera
