#include "server/rpc/blobs.h"

#include <algorithm>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"

namespace tessera {

absl::StatusOr<v1::UploadStatus> BlobsService::BeginUpload(const v1::BeginUploadRequest& request) const {
  TESSERA_ASSIGN_OR_RETURN(const UploadProgress progress,
                           backend_.blobs.BeginUpload(request.sha256(), request.size_bytes()));
  v1::UploadStatus response;
  response.set_committed_bytes(progress.committed_bytes);
  response.set_complete(progress.complete);
  return response;
}

absl::StatusOr<v1::UploadStatus> BlobsService::WriteBlob(
    const std::function<bool(v1::WriteChunk&)>& next) const {
  v1::WriteChunk chunk;
  if (!next(chunk)) {
    return absl::InvalidArgumentError("the stream ended before its first message");
  }
  const std::string sha256 = chunk.sha256();
  TESSERA_ASSIGN_OR_RETURN(UploadSession session, backend_.blobs.OpenUpload(sha256));
  absl::Status status;
  do {
    if (!chunk.sha256().empty() && chunk.sha256() != sha256) {
      status = WithReason(absl::InvalidArgumentError(absl::StrCat("one stream writes one blob: ", sha256)),
                          "ARGUMENT_INVALID", "sha256");
    } else if (chunk.data().size() > kChunkBytes) {
      status = WithReason(absl::InvalidArgumentError(absl::StrCat("a chunk has ", chunk.data().size(),
                                                                  " bytes, at most ", kChunkBytes)),
                          "ARGUMENT_INVALID", "data");
    } else {
      status = session.Append(chunk.offset(), std::as_bytes(std::span(chunk.data())));
    }
  } while (status.ok() && next(chunk));
  const absl::StatusOr<UploadProgress> progress = session.Commit();
  TESSERA_RETURN_IF_ERROR(status);
  TESSERA_RETURN_IF_ERROR(progress.status());
  v1::UploadStatus response;
  response.set_committed_bytes(progress->committed_bytes);
  response.set_complete(progress->complete);
  return response;
}

absl::Status BlobsService::ReadBlob(const v1::ReadBlobRequest& request,
                                    const std::function<bool(const v1::DataChunk&)>& write) const {
  TESSERA_RETURN_IF_ERROR(CheckDigest(request.sha256(), "sha256"));
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const BlobHandle> blob,
                           backend_.blobs.Get(request.sha256()));
  if (request.offset() > blob->size_bytes()) {
    return WithReason(
        absl::OutOfRangeError(absl::StrCat("offset ", request.offset(), " is beyond the blob's ",
                                           blob->size_bytes(), " bytes")),
        "ARGUMENT_INVALID", "offset");
  }
  v1::DataChunk chunk;
  for (uint64_t offset = request.offset(); offset < blob->size_bytes(); offset += chunk.data().size()) {
    chunk.mutable_data()->resize(std::min<uint64_t>(kChunkBytes, blob->size_bytes() - offset));
    TESSERA_RETURN_IF_ERROR(blob->ReadAt(offset, std::as_writable_bytes(std::span(*chunk.mutable_data()))));
    if (!write(chunk)) {
      return absl::CancelledError("the caller went away");
    }
  }
  return absl::OkStatus();
}

}  // namespace tessera
