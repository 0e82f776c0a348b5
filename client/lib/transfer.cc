// The blob calls of Client: uploads, downloads and what is fetched through the cache.
#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <limits>
#include <utility>

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "btf/base/atomic_file.h"
#include "btf/base/file_error.h"
#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "client/lib/background_sha256.h"
#include "client/lib/blob_cache.h"
#include "client/lib/client.h"
#include "client/lib/stubs.h"

namespace tessera {
namespace {

constexpr uint64_t kChunkBytes = 1 << 20;  // tessera.proto: at most 1 MiB
// The announced size of a blob is only a hint until its bytes are here.
constexpr uint64_t kLargestReserve = uint64_t{1} << 30;

// `count` bytes from `offset` on, into `chunk`.
using ReadAt = std::function<absl::Status(uint64_t offset, uint64_t count, std::string& chunk)>;

absl::Status Upload(v1::Blobs::Stub& blobs, const v1::Blob& blob, const ReadAt& read_at,
                    const RetryPolicy& retry, const RunContext& context) {
  v1::BeginUploadRequest begin;
  begin.set_sha256(blob.sha256());
  begin.set_size_bytes(blob.size_bytes());
  Backoff backoff(retry, context);
  uint64_t furthest = 0;
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(v1::UploadStatus reached,
                             CallUnary(blobs, &v1::Blobs::Stub::BeginUpload, begin, retry, context));
    if (reached.complete()) {
      context.Report("uploading", blob.size_bytes(), blob.size_bytes(), "bytes");
      return absl::OkStatus();
    }
    if (reached.committed_bytes() > furthest) {
      furthest = reached.committed_bytes();
      backoff.Reset();
    }
    StoppableCall call(context);
    v1::UploadStatus ended;
    const std::unique_ptr<grpc::ClientWriter<v1::WriteChunk>> stream = blobs.WriteBlob(call.rpc(), &ended);
    v1::WriteChunk chunk;
    chunk.set_sha256(blob.sha256());
    uint64_t offset = reached.committed_bytes();
    absl::Status local;
    bool open = true;
    // An empty blob still takes one message: it names the digest.
    do {
      const uint64_t count = std::min(kChunkBytes, blob.size_bytes() - std::min(offset, blob.size_bytes()));
      local = read_at(offset, count, *chunk.mutable_data());
      if (!local.ok()) {
        call.rpc()->TryCancel();
        break;
      }
      chunk.set_offset(offset);
      open = stream->Write(chunk);
      chunk.clear_sha256();
      offset += count;
      context.Report("uploading", offset, blob.size_bytes(), "bytes");
    } while (open && offset < blob.size_bytes());
    if (open) {
      stream->WritesDone();
    }
    const absl::Status status = StatusFromGrpc(stream->Finish());
    TESSERA_RETURN_IF_ERROR(local);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (status.ok() && ended.complete()) {
      return absl::OkStatus();
    }
    // Two uploads of the same bytes may race; the loser continues where the winner stands.
    if (!status.ok() && !absl::IsUnavailable(status) && ReasonOf(status) != "OFFSET_MISMATCH") {
      return status;
    }
    TESSERA_RETURN_IF_ERROR(backoff.Wait(
        status.ok() ? absl::UnavailableError(absl::StrCat("the server ended the upload of ", blob.sha256(),
                                                          " at byte ", ended.committed_bytes()))
                    : status));
  }
}

// Reads the bytes once for their digest and once more to send them.
absl::StatusOr<v1::Blob> UploadFrom(v1::Blobs::Stub& blobs, uint64_t size, const ReadAt& read_at,
                                    const RetryPolicy& retry, const RunContext& context) {
  Sha256 digest;
  std::string chunk;
  for (uint64_t offset = 0; offset < size; offset += chunk.size()) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    TESSERA_RETURN_IF_ERROR(read_at(offset, std::min(kChunkBytes, size - offset), chunk));
    digest.Update(std::as_bytes(std::span(chunk)));
    context.Report("checking", offset + chunk.size(), size, "bytes");
  }
  v1::Blob blob;
  blob.set_sha256(digest.HexDigest());
  blob.set_size_bytes(size);
  TESSERA_RETURN_IF_ERROR(Upload(blobs, blob, read_at, retry, context));
  return blob;
}

// May take the bytes away: what is left in `chunk` is overwritten.
using Sink = std::function<absl::Status(std::string& chunk)>;

// Streams the bytes of `blob` from `offset` on to `sink`, across lost connections, and checks the size.
absl::Status Download(v1::Blobs::Stub& blobs, const v1::Blob& blob, uint64_t offset, const Sink& sink,
                      const RetryPolicy& retry, const RunContext& context) {
  Backoff backoff(retry, context);
  while (true) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    v1::ReadBlobRequest request;
    request.set_sha256(blob.sha256());
    request.set_offset(offset);
    StoppableCall call(context);
    const std::unique_ptr<grpc::ClientReader<v1::DataChunk>> stream = blobs.ReadBlob(call.rpc(), request);
    v1::DataChunk chunk;
    while (stream->Read(&chunk)) {
      offset += chunk.data().size();
      if (offset > blob.size_bytes()) {
        call.rpc()->TryCancel();
        (void)stream->Finish();
        return absl::DataLossError(absl::StrCat("blob ", blob.sha256(), ": more than the ", blob.size_bytes(),
                                                " bytes it should have"));
      }
      if (absl::Status local = sink(*chunk.mutable_data()); !local.ok()) {
        call.rpc()->TryCancel();
        (void)stream->Finish();
        return local;
      }
      backoff.Reset();
      context.Report("downloading", offset, blob.size_bytes(), "bytes");
    }
    const absl::Status status = StatusFromGrpc(stream->Finish());
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (status.ok() && offset == blob.size_bytes()) {
      return absl::OkStatus();
    }
    if (status.ok()) {
      return absl::DataLossError(absl::StrCat("blob ", blob.sha256(), ": ended after ", offset, " of ",
                                              blob.size_bytes(), " bytes"));
    }
    if (!absl::IsUnavailable(status)) {
      return status;
    }
    TESSERA_RETURN_IF_ERROR(backoff.Wait(status));
  }
}

// Room for the blob, in large pages where the system has them: a page fault for every 4 KiB received shows.
void Reserve(const v1::Blob& blob, std::string& bytes) {
  bytes.reserve(std::min(blob.size_bytes(), kLargestReserve));
#ifdef MADV_HUGEPAGE
  constexpr uintptr_t kPageBytes = uintptr_t{2} << 20;
  const auto begin = reinterpret_cast<uintptr_t>(bytes.data());
  const uintptr_t first = (begin + kPageBytes - 1) / kPageBytes * kPageBytes;
  const uintptr_t last = (begin + bytes.capacity()) / kPageBytes * kPageBytes;
  if (first < last) {
    (void)::madvise(reinterpret_cast<void*>(first), last - first, MADV_HUGEPAGE);  // a wish
  }
#endif
}

// Appends and leaves the hashing to the other thread; `bytes` outlives `digest`.
void AppendAndHash(std::string_view chunk, std::string& bytes, BackgroundSha256& digest) {
  if (bytes.capacity() - bytes.size() < chunk.size()) {
    digest.Wait();  // the bytes move
  }
  const size_t begin = bytes.size();
  bytes.append(chunk);
  digest.Add(std::string_view(bytes).substr(begin));
}

absl::Status CheckDigest(const v1::Blob& blob, std::string_view digest) {
  if (digest != blob.sha256()) {
    return absl::DataLossError(absl::StrCat("blob ", blob.sha256(), ": the bytes received have SHA-256 ",
                                            absl::string_view(digest.data(), digest.size())));
  }
  return absl::OkStatus();
}

std::span<const std::byte> BytesOf(std::string_view text) {
  return std::as_bytes(std::span(text));
}

// An open file that closes itself.
class InputFile {
 public:
  explicit InputFile(const std::filesystem::path& path)
      : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)),
        error_(descriptor_ < 0 ? errno : 0),
        path_(path) {}
  ~InputFile() {
    if (descriptor_ >= 0) {
      ::close(descriptor_);
    }
  }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  absl::StatusOr<uint64_t> Size() const {
    struct stat info = {};
    if (descriptor_ < 0) {
      return FileError(error_, "cannot open", path_);
    }
    if (::fstat(descriptor_, &info) != 0) {
      return FileError(errno, "cannot read", path_);
    }
    if (!S_ISREG(info.st_mode)) {
      return absl::InvalidArgumentError(absl::StrCat(path_.string(), ": not a regular file"));
    }
    return static_cast<uint64_t>(info.st_size);
  }

  // Errors: DATA_LOSS when the file has become shorter.
  absl::Status ReadAt(uint64_t offset, uint64_t count, std::string& chunk) const {
    chunk.resize(count);
    uint64_t done = 0;
    while (done < count) {
      const ssize_t got =
          ::pread(descriptor_, chunk.data() + done, count - done, static_cast<off_t>(offset + done));
      if (got < 0 && errno == EINTR) {
        continue;
      }
      if (got < 0) {
        return FileError(errno, "cannot read", path_);
      }
      if (got == 0) {
        return absl::DataLossError(absl::StrCat(path_.string(), ": became shorter while it was read"));
      }
      done += static_cast<uint64_t>(got);
    }
    return absl::OkStatus();
  }

 private:
  int descriptor_;
  int error_;
  const std::filesystem::path& path_;
};

}  // namespace

std::filesystem::path DefaultCacheFolder() {
  const auto environment = [](const char* name) -> std::filesystem::path {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  };
  // The specification asks to ignore relative values (XDG Base Directory Specification 0.8).
  if (const auto xdg = environment("XDG_CACHE_HOME"); xdg.is_absolute()) {
    return xdg / "tessera";
  }
  if (const auto home = environment("HOME"); home.is_absolute()) {
    return home / ".cache" / "tessera";
  }
  std::error_code error;
  const auto temporary = std::filesystem::temp_directory_path(error);
  return (error ? "/tmp" : temporary) / absl::StrCat("tessera-cache-", ::getuid());
}

absl::StatusOr<v1::Blob> Client::UploadBytes(std::span<const std::byte> bytes, const RunContext& context) {
  return UploadFrom(
      *stubs_->blobs, bytes.size(),
      [bytes](uint64_t offset, uint64_t count, std::string& chunk) {
        const auto part = bytes.subspan(offset, count);
        chunk.assign(reinterpret_cast<const char*>(part.data()), part.size());
        return absl::OkStatus();
      },
      options_.retry, context);
}

absl::StatusOr<v1::Blob> Client::UploadContainer(const ContainerFile& file, const RunContext& context) {
  return UploadFrom(
      *stubs_->blobs, file.size_bytes(),
      [&file](uint64_t offset, uint64_t count, std::string& chunk) {
        chunk.resize(count);
        return file.Read(offset, std::as_writable_bytes(std::span(chunk)));
      },
      options_.retry, context);
}

absl::StatusOr<v1::Blob> Client::UploadFile(const std::filesystem::path& path, const RunContext& context) {
  const InputFile file(path);
  TESSERA_ASSIGN_OR_RETURN(const uint64_t size, file.Size());
  return UploadFrom(
      *stubs_->blobs, size,
      [&file](uint64_t offset, uint64_t count, std::string& chunk) {
        return file.ReadAt(offset, count, chunk);
      },
      options_.retry, context);
}

absl::StatusOr<std::string> Client::ReadBlob(const v1::Blob& blob, const RunContext& context) {
  std::string bytes;
  Reserve(blob, bytes);
  BackgroundSha256 digest;
  TESSERA_RETURN_IF_ERROR(Download(
      *stubs_->blobs, blob, 0,
      [&](std::string& chunk) {
        AppendAndHash(chunk, bytes, digest);
        return absl::OkStatus();
      },
      options_.retry, context));
  TESSERA_RETURN_IF_ERROR(CheckDigest(blob, digest.HexDigest()));
  return bytes;
}

absl::Status Client::DownloadFile(const v1::Blob& blob, const std::filesystem::path& path,
                                  const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(AtomicFile file, AtomicFile::Create(path));
  std::string hashed;  // outlives the digest that reads it
  BackgroundSha256 digest;
  TESSERA_RETURN_IF_ERROR(Download(
      *stubs_->blobs, blob, 0,
      [&](std::string& chunk) {
        digest.Wait();
        hashed.swap(chunk);
        digest.Add(hashed);
        return file.Write(hashed);
      },
      options_.retry, context));
  TESSERA_RETURN_IF_ERROR(CheckDigest(blob, digest.HexDigest()));
  return file.Commit();
}

absl::StatusOr<std::string> Client::FetchBlob(const v1::Blob& blob, const RunContext& context) {
  const BlobCache cache(options_.cache_folder, options_.cache_limit_bytes);
  if (std::optional<std::string> cached = cache.Read(blob.sha256())) {
    return *std::move(cached);
  }
  absl::StatusOr<BlobCache::Partial> partial = cache.Begin(blob.sha256());
  if (!partial.ok()) {
    return ReadBlob(blob, context);
  }
  absl::StatusOr<std::string> earlier = partial->ReadAll();
  std::string bytes = earlier.ok() && earlier->size() <= blob.size_bytes() ? *std::move(earlier) : "";
  bool caching = !bytes.empty() || partial->Clear().ok();
  const bool resumed = !bytes.empty();
  Reserve(blob, bytes);
  BackgroundSha256 digest;
  digest.Add(bytes);
  TESSERA_RETURN_IF_ERROR(Download(
      *stubs_->blobs, blob, bytes.size(),
      [&](std::string& chunk) {
        AppendAndHash(chunk, bytes, digest);
        caching = caching && partial->Append(chunk).ok();
        return absl::OkStatus();
      },
      options_.retry, context));
  const absl::Status checked = CheckDigest(blob, digest.HexDigest());
  if (!checked.ok()) {
    // Bytes left by an earlier process are the likelier culprit: once more, without them.
    const bool cleared = partial->Clear().ok();
    if (resumed && cleared) {
      return ReadBlob(blob, context);
    }
    return checked;
  }
  if (caching) {
    // The caller has the bytes; a cache that takes them no more costs only the next download.
    (void)cache.Finish(*std::move(partial), blob.sha256());
  } else {
    (void)partial->Clear();
  }
  return bytes;
}

absl::StatusOr<Material> Client::FetchMaterial(std::string_view name, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const v1::Material material, GetMaterial(name, context));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, FetchBlob(material.blob(), context));
  return ParseMaterial(BytesOf(bytes));
}

absl::StatusOr<TileSet> Client::FetchTileSet(std::string_view name, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, GetTileSet(name, context));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, FetchBlob(tile_set.blob(), context));
  return ParseTileSet(BytesOf(bytes));
}

absl::StatusOr<Dressing> Client::FetchDressing(const v1::Blob& blob, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, FetchBlob(blob, context));
  return ParseDressing(BytesOf(bytes));
}

absl::StatusOr<std::string> Client::RenderPreview(v1::RenderPreviewRequest request,
                                                  const RunContext& context) {
  Backoff backoff(options_.retry, context);
  while (true) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    StoppableCall call(context);
    const std::unique_ptr<grpc::ClientReader<v1::RenderPreviewResponse>> stream =
        stubs_->previews->RenderPreview(call.rpc(), request);
    std::string bytes;
    v1::RenderPreviewResponse response;
    while (stream->Read(&response)) {
      bytes.append(response.data());
      if (response.has_progress()) {
        const v1::JobProgress& progress = response.progress();
        context.Report(progress.stage(), progress.done(), progress.total(), progress.unit());
      }
    }
    const absl::Status status = StatusFromGrpc(stream->Finish());
    if (status.ok()) {
      return bytes;
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (!absl::IsUnavailable(status)) {
      return status;
    }
    TESSERA_RETURN_IF_ERROR(backoff.Wait(status));
  }
}

}  // namespace tessera
