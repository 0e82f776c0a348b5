// What the services stand on, and what several of them share: idempotent mutations, and work that ends when
// its caller goes away.
#pragma once

#include <chrono>
#include <functional>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "server/catalog/blob_store.h"
#include "server/catalog/clock.h"
#include "server/catalog/connections.h"
#include "server/catalog/job_table.h"
#include "server/catalog/resources.h"
#include "server/jobs/job.h"
#include "server/jobs/job_events.h"
#include "server/jobs/worker_pool.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Largest piece of a blob in one message.
inline constexpr size_t kChunkBytes = 1 << 20;

// Borrowed parts, all thread-safe; they outlive the services.
struct Backend {
  Connections& connections;
  BlobStore& blobs;
  JobEvents& events;
  WorkerPool& pool;
  Clock clock;
};

// Whether the caller has gone away. Called from any thread.
using IsCancelled = std::function<bool()>;

// Runs `work` on a thread of its own and asks it to stop once the caller is gone.
[[nodiscard]] absl::Status RunForCaller(const IsCancelled& is_cancelled,
                                        const std::function<absl::Status(const RunContext&)>& work);

// Runs `change` in a write transaction, unless a call with this request_id and content was answered before:
// then returns that answer. `method` keeps equal requests of two methods apart. An empty id means no such
// protection. Errors: INVALID_ARGUMENT when the id was used for another content, or is longer than 128 bytes;
// `change`'s.
[[nodiscard]] absl::Status Mutate(const Backend& backend, const std::string& method,
                                  const std::string& request_id, const google::protobuf::Message& request,
                                  google::protobuf::Message& response,
                                  const std::function<absl::Status(Database&)>& change);

// The answer to an earlier call with this request_id and content, so that nothing is checked or parsed again.
[[nodiscard]] absl::StatusOr<bool> FindEarlierAnswer(const Backend& backend, const std::string& method,
                                                     const std::string& request_id,
                                                     const google::protobuf::Message& request,
                                                     google::protobuf::Message& response);

// Queues a job for the answer of a mutation and wakes a worker.
[[nodiscard]] absl::StatusOr<v1::Job> QueueJob(const Backend& backend, const std::string& method,
                                               const std::string& request_id,
                                               const google::protobuf::Message& request, const NewJob& job);

}  // namespace tessera
