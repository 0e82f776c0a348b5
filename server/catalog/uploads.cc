// The half of BlobStore that takes uploads.
#include <fcntl.h>
#include <unistd.h>

#include <absl/strings/str_cat.h>

#include "proto/wire/names.h"
#include "proto/wire/status.h"
#include "server/catalog/blob_store.h"

namespace tessera {
namespace {

constexpr size_t kHashBlockBytes = 1 << 20;
constexpr std::string_view kEmptySha256 = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";

}  // namespace

struct UploadSession::Upload {
  explicit Upload(std::string digest) : sha256(std::move(digest)) {}
  const std::string sha256;

  std::mutex mutex;  // guards what follows
  bool opened = false;
  uint64_t size_bytes = 0;
  File file;
  Sha256 hash;  // of the first written_bytes
  uint64_t written_bytes = 0;
  uint64_t committed_bytes = 0;
  bool complete = false;
  bool forgotten = false;  // declared anew or expired: sessions must begin again
};

absl::StatusOr<UploadProgress> BlobStore::BeginUpload(const std::string& sha256, uint64_t size_bytes) {
  TESSERA_RETURN_IF_ERROR(CheckDigest(sha256, "sha256"));
  if (size_bytes > max_upload_bytes_) {
    return WithReason(
        absl::ResourceExhaustedError(
            absl::StrCat("the upload has ", size_bytes, " bytes, at most ", max_upload_bytes_, " are taken")),
        "UPLOAD_TOO_LARGE", sha256);
  }
  if (size_bytes == 0) {
    if (sha256 != kEmptySha256) {
      return WithReason(absl::InvalidArgumentError("no bytes have another digest than the declared one"),
                        "DIGEST_MISMATCH", sha256);
    }
    TESSERA_RETURN_IF_ERROR(Put("").status());
  }

  UploadProgress progress;
  bool known = false;
  bool resized = false;
  TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_RETURN_IF_ERROR(db.Run("UPDATE blobs SET touch_ms = ? WHERE sha256 = ?", clock_(), sha256));
    if (db.changes() > 0) {
      TESSERA_ASSIGN_OR_RETURN(Statement blob,
                               db.Query("SELECT size_bytes FROM blobs WHERE sha256 = ?", sha256));
      TESSERA_RETURN_IF_ERROR(blob.Step().status());
      if (static_cast<uint64_t>(blob.Int(0)) != size_bytes) {
        return absl::InvalidArgumentError(
            absl::StrCat("blob ", sha256, " has ", blob.Int(0), " bytes, declared ", size_bytes));
      }
      progress = {size_bytes, true};
      return absl::OkStatus();
    }
    TESSERA_ASSIGN_OR_RETURN(
        Statement row, db.Query("SELECT size_bytes, committed_bytes FROM uploads WHERE sha256 = ?", sha256));
    TESSERA_ASSIGN_OR_RETURN(known, row.Step());
    if (known) {
      resized = static_cast<uint64_t>(row.Int(0)) != size_bytes;
      progress.committed_bytes = resized ? 0 : static_cast<uint64_t>(row.Int(1));
    }
    return absl::OkStatus();
  }));
  if (progress.complete) {
    return progress;
  }
  TESSERA_RETURN_IF_ERROR(CheckSpace(size_bytes - progress.committed_bytes));
  if (resized) {
    ForgetUpload(sha256);  // one of the two declared a wrong size; the digest decides at the end
  }
  if (!known || resized) {
    TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) {
      return db.Run(
          "INSERT INTO uploads (sha256, size_bytes, committed_bytes, touch_ms) VALUES (?, ?, 0, ?)"
          " ON CONFLICT (sha256) DO UPDATE SET committed_bytes = iif(size_bytes = excluded.size_bytes,"
          " committed_bytes, 0), size_bytes = excluded.size_bytes, touch_ms = excluded.touch_ms",
          sha256, size_bytes, clock_());
    }));
  }
  return progress;
}

absl::StatusOr<UploadSession> BlobStore::OpenUpload(const std::string& sha256) {
  TESSERA_RETURN_IF_ERROR(CheckDigest(sha256, "sha256"));
  for (;;) {
    std::shared_ptr<UploadSession::Upload> upload;
    {
      const std::lock_guard lock(uploads_mutex_);
      std::erase_if(uploads_, [](const auto& entry) { return entry.second.expired(); });
      std::weak_ptr<UploadSession::Upload>& entry = uploads_[sha256];
      upload = entry.lock();
      if (upload == nullptr) {
        entry = upload = std::make_shared<UploadSession::Upload>(sha256);
      }
    }
    // Hashing what is there may take seconds: only who wants the same upload waits.
    absl::Status status;
    bool usable = false;
    {
      const std::lock_guard lock(upload->mutex);
      if (!upload->forgotten && !upload->opened) {
        status = ContinueUpload(*upload);
        upload->opened = status.ok();
        upload->forgotten = !status.ok();
      }
      usable = !upload->forgotten;
    }
    if (usable) {
      return UploadSession(*this, std::move(upload));
    }
    {
      const std::lock_guard lock(uploads_mutex_);
      if (const auto it = uploads_.find(sha256); it != uploads_.end() && it->second.lock() == upload) {
        uploads_.erase(it);
      }
    }
    TESSERA_RETURN_IF_ERROR(status);
  }
}

absl::Status BlobStore::ContinueUpload(UploadSession::Upload& upload) {
  TESSERA_RETURN_IF_ERROR(connections_.Read([&](Database& db) -> absl::Status {
    TESSERA_ASSIGN_OR_RETURN(Statement blob,
                             db.Query("SELECT size_bytes FROM blobs WHERE sha256 = ?", upload.sha256));
    TESSERA_ASSIGN_OR_RETURN(upload.complete, blob.Step());
    if (upload.complete) {
      upload.size_bytes = upload.committed_bytes = upload.written_bytes = static_cast<uint64_t>(blob.Int(0));
      return absl::OkStatus();
    }
    TESSERA_ASSIGN_OR_RETURN(
        Statement row,
        db.Query("SELECT size_bytes, committed_bytes FROM uploads WHERE sha256 = ?", upload.sha256));
    TESSERA_ASSIGN_OR_RETURN(const bool known, row.Step());
    if (!known) {
      return WithReason(absl::NotFoundError(absl::StrCat("no upload of ", upload.sha256, " was begun")),
                        "NOT_FOUND", upload.sha256);
    }
    upload.size_bytes = static_cast<uint64_t>(row.Int(0));
    upload.committed_bytes = static_cast<uint64_t>(row.Int(1));
    return absl::OkStatus();
  }));
  if (!upload.complete) {
    TESSERA_ASSIGN_OR_RETURN(upload.file, File::Open(uploads_folder_ / upload.sha256, O_RDWR | O_CREAT));
    if (upload.committed_bytes == 0) {
      TESSERA_RETURN_IF_ERROR(SyncFolder(uploads_folder_));
    }
    // Bytes after the committed offset may be anything after a crash.
    TESSERA_ASSIGN_OR_RETURN(const uint64_t file_bytes, upload.file.Size());
    upload.committed_bytes = std::min(upload.committed_bytes, file_bytes);
    TESSERA_RETURN_IF_ERROR(upload.file.Truncate(upload.committed_bytes));
    std::string block(kHashBlockBytes, '\0');
    while (upload.written_bytes < upload.committed_bytes) {
      const size_t size = std::min<uint64_t>(block.size(), upload.committed_bytes - upload.written_bytes);
      const auto bytes = std::as_writable_bytes(std::span(block)).first(size);
      TESSERA_RETURN_IF_ERROR(upload.file.ReadAt(upload.written_bytes, bytes).status());
      upload.hash.Update(bytes);
      upload.written_bytes += size;
    }
  }
  return absl::OkStatus();
}

void BlobStore::ForgetUpload(const std::string& sha256) {
  std::shared_ptr<UploadSession::Upload> upload;
  {
    const std::lock_guard lock(uploads_mutex_);
    if (const auto it = uploads_.find(sha256); it != uploads_.end()) {
      upload = it->second.lock();
    }
  }
  if (upload != nullptr) {  // OpenUpload drops it from the map

    const std::lock_guard lock(upload->mutex);
    upload->forgotten = true;
  }
}

absl::Status BlobStore::FinishUpload(UploadSession::Upload& upload) {
  const std::shared_lock keep(collect_mutex_);
  const auto uploaded = uploads_folder_ / upload.sha256;
  const auto stored = blobs_folder_ / upload.sha256;
  upload.forgotten = true;  // the hash is used up: after a failure the session must begin again
  if (upload.hash.HexDigest() != upload.sha256) {
    TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) {
      return db.Run("UPDATE uploads SET committed_bytes = 0, touch_ms = ? WHERE sha256 = ?", clock_(),
                    upload.sha256);
    }));
    TESSERA_RETURN_IF_ERROR(upload.file.Truncate(0));
    return WithReason(
        absl::InvalidArgumentError(absl::StrCat(
            "the ", upload.size_bytes, " uploaded bytes do not have the declared SHA-256 ", upload.sha256)),
        "DIGEST_MISMATCH", upload.sha256);
  }
  StagedBlob staged;
  staged.sha256_ = upload.sha256;
  staged.size_bytes_ = upload.size_bytes;
  if (upload.size_bytes <= kMaxInlineBytes) {
    std::string bytes(upload.size_bytes, '\0');
    TESSERA_RETURN_IF_ERROR(upload.file.ReadAt(0, std::as_writable_bytes(std::span(bytes))).status());
    staged.inline_bytes_ = std::move(bytes);
  } else {
    TESSERA_RETURN_IF_ERROR(RenameDurably(uploaded, stored));
  }
  const absl::Status status = connections_.Write([&](Database& db) -> absl::Status {
    TESSERA_RETURN_IF_ERROR(staged.InsertRow(db, clock_()));
    return db.Run("DELETE FROM uploads WHERE sha256 = ?", upload.sha256);
  });
  if (!status.ok()) {
    if (!staged.inline_bytes_) {
      RenameDurably(stored, uploaded).IgnoreError();  // else the next start does it
    }
    return status;
  }
  unlink(uploaded.c_str());  // of an inline blob
  upload.forgotten = false;
  upload.complete = true;
  return absl::OkStatus();
}

absl::Status BlobStore::CommitUpload(UploadSession::Upload& upload) {
  TESSERA_RETURN_IF_ERROR(upload.file.Sync());
  if (upload.written_bytes == upload.size_bytes) {
    TESSERA_RETURN_IF_ERROR(FinishUpload(upload));
  } else {
    TESSERA_RETURN_IF_ERROR(connections_.Write([&](Database& db) {
      return db.Run("UPDATE uploads SET committed_bytes = ?, touch_ms = ? WHERE sha256 = ?",
                    upload.written_bytes, clock_(), upload.sha256);
    }));
  }
  upload.committed_bytes = upload.written_bytes;
  return absl::OkStatus();
}

absl::Status UploadSession::Append(uint64_t offset, std::span<const std::byte> bytes) {
  Upload& upload = *upload_;
  const std::lock_guard lock(upload.mutex);
  if (upload.forgotten) {
    return absl::AbortedError("the upload was begun anew, ask how far it is");
  }
  if (offset > upload.size_bytes || bytes.size() > upload.size_bytes - offset) {
    return absl::InvalidArgumentError(absl::StrCat("a chunk of ", bytes.size(), " bytes at ", offset,
                                                   " ends beyond the declared size ", upload.size_bytes));
  }
  if (offset > upload.written_bytes) {
    return WithReason(absl::OutOfRangeError(absl::StrCat("the chunk starts at ", offset, ", the server has ",
                                                         upload.written_bytes, " bytes")),
                      "OFFSET_MISMATCH", upload.sha256);
  }
  const uint64_t known = std::min<uint64_t>(bytes.size(), upload.written_bytes - offset);
  bytes = bytes.subspan(known);
  if (bytes.empty()) {
    return absl::OkStatus();
  }
  TESSERA_RETURN_IF_ERROR(upload.file.WriteAt(upload.written_bytes, bytes));
  upload.hash.Update(bytes);
  upload.written_bytes += bytes.size();
  const bool due = upload.written_bytes - upload.committed_bytes >= kCommitIntervalBytes;
  return due && upload.written_bytes < upload.size_bytes ? store_->CommitUpload(upload) : absl::OkStatus();
}

absl::StatusOr<UploadProgress> UploadSession::Commit() {
  Upload& upload = *upload_;
  const std::lock_guard lock(upload.mutex);
  if (upload.forgotten) {
    return absl::AbortedError("the upload was begun anew, ask how far it is");
  }
  if (!upload.complete &&
      (upload.written_bytes > upload.committed_bytes || upload.written_bytes == upload.size_bytes)) {
    TESSERA_RETURN_IF_ERROR(store_->CommitUpload(upload));
  }
  return UploadProgress{upload.committed_bytes, upload.complete};
}

}  // namespace tessera
