// Immutable bytes named by their SHA-256, and resumable uploads of them.
//
// Blobs up to kMaxInlineBytes lie in the catalog; larger ones are files. The order of a write is: temporary
// file, fsync, rename, fsync of the folder, then the row; so a row always has its bytes, and whatever a crash
// leaves behind has no row and is swept at the next start. No path leaves this class.
//
//   TESSERA_ASSIGN_OR_RETURN(StagedBlob staged, store.Stage(bytes));
//   TESSERA_RETURN_IF_ERROR(connections.Write([&](Database& db) { return staged.InsertRow(db, now_ms); }));
//
// Uploads: BeginUpload declares digest and size; an UploadSession appends chunks. Committed bytes are on the
// medium and recorded in the catalog; that is done every kCommitIntervalBytes and whenever the client pauses
// (Commit).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <span>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/sha256.h"
#include "server/catalog/clock.h"
#include "server/catalog/connections.h"
#include "server/catalog/files.h"

namespace tessera {

inline constexpr uint64_t kMaxInlineBytes = 64 << 10;
inline constexpr uint64_t kCommitIntervalBytes = 8 << 20;
inline constexpr int64_t kUnnamedBlobKeptMs = int64_t{24} * 3600 * 1000;

// Where a blob's bytes can be read. Stays readable after the blob was deleted. Thread-safe.
class BlobHandle {
 public:
  explicit BlobHandle(std::string inline_bytes);
  BlobHandle(File file, uint64_t size_bytes) : file_(std::move(file)), size_bytes_(size_bytes) {}

  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  // Fills `bytes` from `offset`. Errors: OUT_OF_RANGE, DATA_LOSS (BLOB_CORRUPT) when the file is too short.
  [[nodiscard]] absl::Status ReadAt(uint64_t offset, std::span<std::byte> bytes) const;

 private:
  std::string inline_bytes_;
  File file_;
  uint64_t size_bytes_ = 0;
};

// Bytes that are durable but not yet a blob; while it lives, no blob is collected. Must end in the thread
// that staged.
class StagedBlob {
 public:
  [[nodiscard]] const std::string& sha256() const { return sha256_; }
  [[nodiscard]] uint64_t size_bytes() const { return size_bytes_; }
  // Makes it a blob when the transaction commits.
  [[nodiscard]] absl::Status InsertRow(Database& db, int64_t now_ms) const;

 private:
  friend class BlobStore;
  std::shared_lock<std::shared_mutex> keep_;
  std::string sha256_;
  uint64_t size_bytes_ = 0;
  std::optional<std::string> inline_bytes_;
};

struct UploadProgress {
  uint64_t committed_bytes = 0;
  bool complete = false;
};

class BlobStore;

// One client's end of an upload; several may append to the same upload. Thread-safe.
class UploadSession {
 public:
  // Takes the bytes at `offset`; those that were taken before are skipped. Errors: OUT_OF_RANGE
  // (OFFSET_MISMATCH) when bytes before `offset` are missing, INVALID_ARGUMENT beyond the declared size,
  // ABORTED when the upload was declared anew, storage errors.
  [[nodiscard]] absl::Status Append(uint64_t offset, std::span<const std::byte> bytes);
  // Makes what was appended durable; at the declared size checks the digest and makes it a blob.
  // Errors: INVALID_ARGUMENT (DIGEST_MISMATCH; the upload starts again at 0), storage errors.
  [[nodiscard]] absl::StatusOr<UploadProgress> Commit();

 private:
  friend class BlobStore;
  struct Upload;
  UploadSession(BlobStore& store, std::shared_ptr<Upload> upload)
      : store_(&store), upload_(std::move(upload)) {}

  BlobStore* store_;
  std::shared_ptr<Upload> upload_;
};

// Thread-safe.
class BlobStore {
 public:
  // Creates the folders, and removes what a crash left: temporary files, files without a row, scratch
  // folders. `max_upload_bytes` bounds one blob.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<BlobStore>> Open(const std::filesystem::path& folder,
                                                                       Connections& connections, Clock clock,
                                                                       uint64_t max_upload_bytes);

  // Makes `bytes` durable, ready to become a blob.
  [[nodiscard]] absl::StatusOr<StagedBlob> Stage(std::string_view bytes);
  // Stage and InsertRow.
  [[nodiscard]] absl::StatusOr<std::string> Put(std::string_view bytes);

  // Errors: NOT_FOUND (BLOB_MISSING), DATA_LOSS (BLOB_CORRUPT).
  [[nodiscard]] absl::StatusOr<std::shared_ptr<const BlobHandle>> Get(std::string_view sha256);
  // All bytes. Errors: Get's, RESOURCE_EXHAUSTED above `limit_bytes`.
  [[nodiscard]] absl::StatusOr<std::string> ReadAll(std::string_view sha256, uint64_t limit_bytes);

  // Errors: INVALID_ARGUMENT (digest), RESOURCE_EXHAUSTED (UPLOAD_TOO_LARGE, STORAGE_FULL when the disk has
  // no room).
  [[nodiscard]] absl::StatusOr<UploadProgress> BeginUpload(const std::string& sha256, uint64_t size_bytes);
  // Errors: NOT_FOUND when no upload of this digest was begun.
  [[nodiscard]] absl::StatusOr<UploadSession> OpenUpload(const std::string& sha256);

  // Deletes blobs that no name and no job uses, and uploads, untouched for kUnnamedBlobKeptMs.
  [[nodiscard]] absl::Status CollectGarbage();

  // An empty folder for temporary files, removed with the returned owner and, at the latest, at the next
  // start.
  class Scratch {
   public:
    explicit Scratch(std::filesystem::path folder) : folder_(std::move(folder)) {}
    Scratch(const Scratch&) = delete;
    Scratch& operator=(const Scratch&) = delete;
    ~Scratch();
    [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }

   private:
    std::filesystem::path folder_;
  };
  [[nodiscard]] absl::StatusOr<std::unique_ptr<Scratch>> MakeScratch();

 private:
  friend class UploadSession;
  BlobStore(const std::filesystem::path& folder, Connections& connections, Clock clock,
            uint64_t max_upload_bytes);
  [[nodiscard]] absl::Status CreateFolders() const;
  [[nodiscard]] absl::Status Sweep();
  [[nodiscard]] absl::Status CheckSpace(uint64_t needed_bytes) const;
  [[nodiscard]] absl::StatusOr<bool> Exists(const std::string& sha256);
  // Of these three the caller holds upload.mutex. Finds the bytes taken before, and hashes them.
  [[nodiscard]] absl::Status ContinueUpload(UploadSession::Upload& upload);
  [[nodiscard]] absl::Status CommitUpload(UploadSession::Upload& upload);
  [[nodiscard]] absl::Status FinishUpload(UploadSession::Upload& upload);
  void ForgetUpload(const std::string& sha256);

  std::filesystem::path blobs_folder_;
  std::filesystem::path uploads_folder_;
  std::filesystem::path scratch_folder_;
  Connections& connections_;
  Clock clock_;
  uint64_t max_upload_bytes_;

  // Shared while a file waits for its row, exclusive while garbage is collected. Taken before the writer.
  std::shared_mutex collect_mutex_;
  std::mutex uploads_mutex_;
  std::map<std::string, std::weak_ptr<UploadSession::Upload>> uploads_;  // guarded by uploads_mutex_
  std::mutex names_mutex_;
  uint64_t next_name_ = 0;  // guarded by names_mutex_
};

}  // namespace tessera
