// The connection behind a Client, and how one call is made on it. Private to this folder.
#pragma once

#include <stop_token>

#include <grpcpp/grpcpp.h>

#include "client/lib/backoff.h"
#include "client/lib/client.h"
#include "proto/wire/service_stubs.h"
#include "proto/wire/status.h"

namespace tessera {

struct Client::Stubs : ServiceStubs {
  using ServiceStubs::ServiceStubs;
};

// One call's gRPC context; a stop request cancels the call wherever it waits.
class StoppableCall {
 public:
  explicit StoppableCall(const RunContext& context) : cancel_(context.stop, Cancel{&rpc_}) {}
  grpc::ClientContext* rpc() { return &rpc_; }

 private:
  struct Cancel {
    grpc::ClientContext* rpc;
    void operator()() const { rpc->TryCancel(); }
  };
  grpc::ClientContext rpc_;
  std::stop_callback<Cancel> cancel_;  // after rpc_: gone first
};

// A unary call, repeated while the server is UNAVAILABLE.
template <class Stub, class Request, class Response>
absl::StatusOr<Response> CallUnary(
    Stub& stub, grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
    const Request& request, const RetryPolicy& retry, const RunContext& context) {
  Backoff backoff(retry, context);
  while (true) {
    if (absl::Status stop = context.CheckStop(); !stop.ok()) {
      return stop;
    }
    Response response;
    StoppableCall call(context);
    const absl::Status status = StatusFromGrpc((stub.*method)(call.rpc(), request, &response));
    if (status.ok()) {
      return response;
    }
    if (!absl::IsUnavailable(status)) {
      return status;
    }
    if (absl::Status waited = backoff.Wait(status); !waited.ok()) {
      return waited;
    }
  }
}

}  // namespace tessera
