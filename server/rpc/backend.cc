#include "server/rpc/backend.h"

#include <future>
#include <optional>
#include <span>
#include <stop_token>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "proto/wire/status.h"

namespace tessera {
namespace {

constexpr size_t kMaxRequestIdLength = 128;
constexpr std::chrono::milliseconds kCancelPoll{20};

std::string RequestHash(const std::string& method, const google::protobuf::Message& request) {
  const std::string text = absl::StrCat(method, "\n", request.SerializeAsString());
  return Sha256Hex(std::as_bytes(std::span(text)));
}

// True when `response` was filled from the log.
absl::StatusOr<bool> TakeAnswer(Database& db, const std::string& request_id,
                                const std::string& request_sha256, google::protobuf::Message& response) {
  TESSERA_ASSIGN_OR_RETURN(const std::optional<std::string> answer,
                           FindAnswer(db, request_id, request_sha256));
  if (!answer) {
    return false;
  }
  if (!response.ParseFromString(*answer)) {
    return absl::DataLossError("the answer to an earlier call cannot be read back");
  }
  return true;
}

}  // namespace

absl::Status RunForCaller(const IsCancelled& is_cancelled,
                          const std::function<absl::Status(const RunContext&)>& work) {
  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  std::future<absl::Status> done = std::async(std::launch::async, [&] { return work(context); });
  while (done.wait_for(kCancelPoll) != std::future_status::ready) {
    if (is_cancelled()) {
      stop.request_stop();
    }
  }
  return done.get();
}

absl::StatusOr<bool> FindEarlierAnswer(const Backend& backend, const std::string& method,
                                       const std::string& request_id,
                                       const google::protobuf::Message& request,
                                       google::protobuf::Message& response) {
  if (request_id.size() > kMaxRequestIdLength) {
    return WithReason(absl::InvalidArgumentError(absl::StrCat("request_id has ", request_id.size(),
                                                              " bytes, at most ", kMaxRequestIdLength)),
                      "ARGUMENT_INVALID", "request_id");
  }
  bool found = false;
  if (!request_id.empty()) {
    TESSERA_RETURN_IF_ERROR(backend.connections.Read([&](Database& db) -> absl::Status {
      TESSERA_ASSIGN_OR_RETURN(found, TakeAnswer(db, request_id, RequestHash(method, request), response));
      return absl::OkStatus();
    }));
  }
  return found;
}

absl::Status Mutate(const Backend& backend, const std::string& method, const std::string& request_id,
                    const google::protobuf::Message& request, google::protobuf::Message& response,
                    const std::function<absl::Status(Database&)>& change) {
  if (request_id.empty()) {
    return backend.connections.Write(change);
  }
  TESSERA_ASSIGN_OR_RETURN(const bool answered,
                           FindEarlierAnswer(backend, method, request_id, request, response));
  if (answered) {
    return absl::OkStatus();
  }
  const std::string request_sha256 = RequestHash(method, request);
  return backend.connections.Write([&](Database& db) -> absl::Status {
    // The same call may have come in twice at once.
    TESSERA_ASSIGN_OR_RETURN(const bool taken, TakeAnswer(db, request_id, request_sha256, response));
    if (taken) {
      return absl::OkStatus();
    }
    TESSERA_RETURN_IF_ERROR(change(db));
    return RecordAnswer(db, request_id, request_sha256, response.SerializeAsString(), backend.clock());
  });
}

absl::StatusOr<v1::Job> QueueJob(const Backend& backend, const std::string& method,
                                 const std::string& request_id, const google::protobuf::Message& request,
                                 const NewJob& job) {
  v1::Job response;
  TESSERA_RETURN_IF_ERROR(
      Mutate(backend, method, request_id, request, response, [&](Database& db) -> absl::Status {
        NewJob asked = job;
        asked.request_id = request_id;
        TESSERA_ASSIGN_OR_RETURN(JobRecord record, InsertJob(db, asked, backend.clock()));
        response = std::move(record.job);
        return absl::OkStatus();
      }));
  backend.pool.Wake();
  return response;
}

}  // namespace tessera
