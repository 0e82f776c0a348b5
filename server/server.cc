#include "server/server.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <optional>
#include <system_error>
#include <thread>

#include <fcntl.h>
#include <sys/file.h>

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include "btf/base/status_macros.h"
#include "proto/wire/status.h"
#include "server/address.h"
#include "server/catalog/blob_store.h"
#include "server/catalog/connections.h"
#include "server/catalog/files.h"
#include "server/catalog/storage_error.h"
#include "server/jobs/builtin_kinds.h"
#include "server/jobs/job_events.h"
#include "server/jobs/worker_pool.h"
#include "server/rpc/backend.h"
#include "server/rpc/endpoint.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kStopGrace{2000};

// Holds the folder as long as it lives; the kernel lets go of it when the process dies in any way.
absl::StatusOr<File> LockFolder(const std::filesystem::path& folder) {
  TESSERA_ASSIGN_OR_RETURN(File lock, File::Open(folder / "lock", O_RDWR | O_CREAT));
  if (flock(lock.descriptor(), LOCK_EX | LOCK_NB) != 0) {
    return absl::FailedPreconditionError("another tessera-server uses it");
  }
  return lock;
}

// Operators see the folder's name; clients never do.
absl::Status AtFolder(const absl::Status& status, const std::filesystem::path& folder) {
  absl::Status result(status.code(), absl::StrCat("data folder ", folder.string(), ": ", status.message()));
  return WithReason(std::move(result), ReasonOf(status), SubjectOf(status));
}

}  // namespace

// In order of construction; destroyed in reverse.
struct Server::Parts {
  std::string address;
  File lock;
  std::unique_ptr<Connections> connections;
  std::unique_ptr<BlobStore> blobs;
  JobEvents events;
  std::optional<WorkerPool> pool;
  std::optional<Backend> backend;
  std::unique_ptr<Endpoint> endpoint;

  absl::Status OpenFolder(const ServerOptions& options) {
    std::error_code error;
    std::filesystem::create_directories(options.data_folder, error);
    if (error) {
      return StatusFromErrno(error.value(), "create it");
    }
    TESSERA_ASSIGN_OR_RETURN(lock, LockFolder(options.data_folder));
    TESSERA_ASSIGN_OR_RETURN(connections, Connections::Open(options.data_folder / "catalog.sqlite"));
    TESSERA_ASSIGN_OR_RETURN(
        blobs, BlobStore::Open(options.data_folder, *connections, options.clock, options.max_upload_bytes));
    return absl::OkStatus();
  }
};

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

absl::StatusOr<std::unique_ptr<Server>> Server::Start(ServerOptions options) {
  TESSERA_ASSIGN_OR_RETURN(ListenAddress address, ParseListenAddress(options.listen));
  if (!options.insecure && !IsLoopback(address.host)) {
    return absl::FailedPreconditionError(
        absl::StrCat(options.listen,
                     " can be reached from other machines, and there is no TLS and no login: add "
                     "--insecure if every machine of that network may use and delete everything"));
  }
  if (options.num_workers <= 0) {
    options.num_workers = std::max(1, static_cast<int>(std::thread::hardware_concurrency() / 2));
  }
  if (options.job_kinds.empty()) {
    options.job_kinds = BuiltinJobKinds();
  }
  auto parts = std::make_unique<Parts>();
  if (absl::Status status = parts->OpenFolder(options); !status.ok()) {
    return AtFolder(status, options.data_folder);
  }
  parts->pool.emplace(*parts->connections, *parts->blobs, parts->events, std::move(options.job_kinds),
                      options.clock, spdlog::default_logger());
  parts->backend.emplace(
      Backend{*parts->connections, *parts->blobs, parts->events, *parts->pool, options.clock});
  TESSERA_ASSIGN_OR_RETURN(parts->endpoint,
                           Endpoint::Start(options.listen, *parts->backend, options.num_workers));
  TESSERA_RETURN_IF_ERROR(parts->pool->Start(options.num_workers));
  address.port = parts->endpoint->port();
  parts->address = ListenAddressText(address);
  return std::unique_ptr<Server>(new Server(std::move(parts)));
}

Server::~Server() {
  Stop();
}

const std::string& Server::address() const {
  return parts_->address;
}

void Server::Stop() {
  if (parts_->endpoint != nullptr) {
    parts_->pool->Stop();  // first, so that watchers see their jobs go back to the queue
    parts_->endpoint->Stop(kStopGrace);
    parts_->endpoint.reset();
    parts_->blobs.reset();
    parts_->connections.reset();
    parts_->lock = File();
  }
}

}  // namespace tessera
