// The whole server in one object: catalog, blobs, job queue and gRPC services of one data folder.
// tessera-server is a main() around it; tests run it in their own process.
//
//   TESSERA_ASSIGN_OR_RETURN(auto server, Server::Start({.data_folder = dir, .listen = "127.0.0.1:0"}));
//   Connect(server->address());
//   server->Stop();
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/catalog/clock.h"
#include "server/jobs/job.h"

namespace tessera {

struct ServerOptions {
  // Created when missing. One server at a time.
  std::filesystem::path data_folder;
  // HOST:PORT, [HOST]:PORT for IPv6; port 0 takes a free one.
  std::string listen = "127.0.0.1:7723";
  // Jobs run at once; 0: half the cores, at least 1, since each job may use every core.
  int num_workers = 0;
  // Lets `listen` be an address that other machines reach: there is no TLS and no login yet.
  bool insecure = false;
  // Largest blob a client may upload.
  uint64_t max_upload_bytes = uint64_t{64} << 30;
  Clock clock = &SystemClockMs;
  // Empty: BuiltinJobKinds().
  std::vector<JobKind> job_kinds;
};

class Server {
 public:
  // A server that answers. Errors: INVALID_ARGUMENT (address), FAILED_PRECONDITION (an address that is not
  // loopback without `insecure`; the folder is in use, made by a newer program, or cannot be written:
  // STORAGE_READ_ONLY), UNAVAILABLE (address taken), storage errors.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<Server>> Start(ServerOptions options);
  // Stops.
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  // HOST:PORT that it listens on, with the real port.
  [[nodiscard]] const std::string& address() const;
  // Hands running jobs back to the queue, lets calls in flight end, closes the catalog. Idempotent.
  void Stop();

 private:
  struct Parts;
  explicit Server(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace tessera
