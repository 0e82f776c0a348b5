// The gRPC stubs of every service of one server. Header only: whoever calls the services includes the
// generated gRPC code, nobody else.
#pragma once

#include <memory>

#include <grpcpp/channel.h>

#include "tessera/v1/tessera.grpc.pb.h"

namespace tessera {

struct ServiceStubs {
  explicit ServiceStubs(const std::shared_ptr<grpc::Channel>& channel)
      : materials(v1::Materials::NewStub(channel)),
        arrangements(v1::Arrangements::NewStub(channel)),
        tile_sets(v1::TileSets::NewStub(channel)),
        jobs(v1::Jobs::NewStub(channel)),
        dressings(v1::Dressings::NewStub(channel)),
        previews(v1::Previews::NewStub(channel)),
        blobs(v1::Blobs::NewStub(channel)),
        server_info(v1::ServerInfo::NewStub(channel)) {}

  std::unique_ptr<v1::Materials::Stub> materials;
  std::unique_ptr<v1::Arrangements::Stub> arrangements;
  std::unique_ptr<v1::TileSets::Stub> tile_sets;
  std::unique_ptr<v1::Jobs::Stub> jobs;
  std::unique_ptr<v1::Dressings::Stub> dressings;
  std::unique_ptr<v1::Previews::Stub> previews;
  std::unique_ptr<v1::Blobs::Stub> blobs;
  std::unique_ptr<v1::ServerInfo::Stub> server_info;
};

}  // namespace tessera
