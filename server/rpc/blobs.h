// The service tessera.v1.Blobs: chunked, resumable transfer of bytes named by their SHA-256.
#pragma once

#include <functional>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/rpc/backend.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Each function is the RPC of its name. Thread-safe.
class BlobsService {
 public:
  explicit BlobsService(const Backend& backend) : backend_(backend) {}

  [[nodiscard]] absl::StatusOr<v1::UploadStatus> BeginUpload(const v1::BeginUploadRequest& request) const;
  // `next` fills in the next message, false at the end of the stream, regular or not. What came before an
  // error or a broken connection is kept.
  [[nodiscard]] absl::StatusOr<v1::UploadStatus> WriteBlob(
      const std::function<bool(v1::WriteChunk&)>& next) const;
  // `write` is false once the caller is gone.
  [[nodiscard]] absl::Status ReadBlob(const v1::ReadBlobRequest& request,
                                      const std::function<bool(const v1::DataChunk&)>& write) const;

 private:
  const Backend& backend_;
};

}  // namespace tessera
