// Plain gRPC stubs of a server, and the calls that tests repeat. The only header of the tests that reads the
// generated gRPC code.
#pragma once

#include <memory>
#include <string>

#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include "btf/base/sha256.h"
#include "proto/wire/service_stubs.h"
#include "proto/wire/status.h"

namespace tessera {

inline std::string DigestOf(const std::string& bytes) {
  return Sha256Hex(std::as_bytes(std::span(bytes)));
}

struct Stubs : ServiceStubs {
  explicit Stubs(const std::string& address)
      : Stubs(grpc::CreateChannel(address, grpc::InsecureChannelCredentials())) {}
  explicit Stubs(const std::shared_ptr<grpc::Channel>& connection)
      : ServiceStubs(connection), channel(connection) {}

  // Calls a unary method: Call(&v1::Jobs::Stub::GetJob, *jobs, request).
  template <typename Stub, typename Request, typename Response>
  static absl::StatusOr<Response> Call(grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                                    Response*),
                                       Stub& stub, const Request& request) {
    grpc::ClientContext context;
    Response response;
    const grpc::Status status = (stub.*method)(&context, request, &response);
    if (!status.ok()) {
      return StatusFromGrpc(status);
    }
    return response;
  }

  absl::StatusOr<v1::UploadStatus> BeginUpload(const std::string& bytes) const {
    v1::BeginUploadRequest request;
    request.set_sha256(DigestOf(bytes));
    request.set_size_bytes(bytes.size());
    return Call(&v1::Blobs::Stub::BeginUpload, *blobs, request);
  }
  // Sends bytes [from, to) of the blob.
  absl::StatusOr<v1::UploadStatus> Write(const std::string& bytes, size_t from, size_t to) const {
    grpc::ClientContext context;
    v1::UploadStatus response;
    auto writer = blobs->WriteBlob(&context, &response);
    v1::WriteChunk chunk;
    chunk.set_sha256(DigestOf(bytes));
    for (size_t offset = from; offset < to; offset += chunk.data().size()) {
      chunk.set_offset(offset);
      chunk.set_data(bytes.substr(offset, std::min<size_t>(1 << 20, to - offset)));
      if (!writer->Write(chunk)) {
        break;
      }
      chunk.clear_sha256();
    }
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    if (!status.ok()) {
      return StatusFromGrpc(status);
    }
    return response;
  }
  std::string Upload(const std::string& bytes) const {
    EXPECT_TRUE(BeginUpload(bytes).ok());
    const auto done = Write(bytes, 0, bytes.size());
    EXPECT_TRUE(done.ok() && done->complete()) << done.status();
    return DigestOf(bytes);
  }
  absl::StatusOr<std::string> Download(const std::string& sha256, uint64_t offset = 0) const {
    grpc::ClientContext context;
    v1::ReadBlobRequest request;
    request.set_sha256(sha256);
    request.set_offset(offset);
    auto reader = blobs->ReadBlob(&context, request);
    std::string bytes;
    for (v1::DataChunk chunk; reader->Read(&chunk);) {
      bytes += chunk.data();
    }
    const grpc::Status status = reader->Finish();
    if (!status.ok()) {
      return StatusFromGrpc(status);
    }
    return bytes;
  }

  // A small job of some tenths of a second.
  static v1::GenerateMaterialRequest SmallMaterial(const std::string& name, uint64_t seed = 1) {
    v1::GenerateMaterialRequest request;
    request.set_name("materials/" + name);
    request.set_kind("wrinkles");
    request.set_size(32);
    request.set_lights("3x4");
    request.set_views("3x4");
    request.set_seed(seed);
    request.mutable_encode()->set_kl(4);
    request.mutable_encode()->set_kv(4);
    return request;
  }
  absl::StatusOr<v1::Job> Generate(const v1::GenerateMaterialRequest& request) const {
    return Call(&v1::Materials::Stub::GenerateMaterial, *materials, request);
  }
  absl::StatusOr<v1::Material> GetMaterial(const std::string& name) const {
    v1::GetMaterialRequest request;
    request.set_name("materials/" + name);
    return Call(&v1::Materials::Stub::GetMaterial, *materials, request);
  }
  absl::StatusOr<v1::Job> GetJob(const std::string& name) const {
    v1::GetJobRequest request;
    request.set_name(name);
    return Call(&v1::Jobs::Stub::GetJob, *jobs, request);
  }
  absl::StatusOr<v1::Job> Cancel(const std::string& name) const {
    v1::CancelJobRequest request;
    request.set_name(name);
    return Call(&v1::Jobs::Stub::CancelJob, *jobs, request);
  }
  absl::StatusOr<v1::Job> Wait(const std::string& name, uint32_t timeout_ms = 60'000) const {
    v1::WaitJobRequest request;
    request.set_name(name);
    request.set_timeout_ms(timeout_ms);
    return Call(&v1::Jobs::Stub::WaitJob, *jobs, request);
  }

  std::shared_ptr<grpc::Channel> channel;
};

}  // namespace tessera
