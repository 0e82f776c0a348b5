// A server that misbehaves on demand: what the real one cannot be made to do reliably.
#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <grpc/support/time.h>
#include <grpcpp/grpcpp.h>

#include "tessera/v1/tessera.grpc.pb.h"

namespace tessera {

inline const grpc::Status kGone(grpc::StatusCode::UNAVAILABLE, "going away");

class FakeBlobs final : public v1::Blobs::Service {
 public:
  // Ends the first `failures` streams of either direction after `bytes_before_failure` bytes.
  std::atomic<int> failures{0};
  uint64_t bytes_before_failure = 0;
  // Flips a bit of what is downloaded.
  bool corrupt = false;

  std::map<std::string, std::string> blobs;        // complete
  std::map<std::string, std::string> uploads;      // committed so far
  std::map<std::string, uint64_t> declared_sizes;  // of the uploads
  std::vector<uint64_t> upload_offsets;            // where each stream began
  std::vector<uint64_t> download_offsets;

  grpc::Status BeginUpload(grpc::ServerContext*, const v1::BeginUploadRequest* request,
                           v1::UploadStatus* status) override {
    const std::lock_guard lock(mutex_);
    declared_sizes[request->sha256()] = request->size_bytes();
    status->set_complete(blobs.contains(request->sha256()));
    status->set_committed_bytes(uploads[request->sha256()].size());
    return grpc::Status::OK;
  }

  grpc::Status WriteBlob(grpc::ServerContext*, grpc::ServerReader<v1::WriteChunk>* reader,
                         v1::UploadStatus* status) override {
    const std::lock_guard lock(mutex_);
    v1::WriteChunk chunk;
    std::string sha256;
    while (reader->Read(&chunk)) {
      if (!chunk.sha256().empty()) {
        sha256 = chunk.sha256();
        upload_offsets.push_back(chunk.offset());
      }
      std::string& upload = uploads[sha256];
      if (chunk.offset() != upload.size()) {
        return {grpc::StatusCode::FAILED_PRECONDITION, "offset"};
      }
      upload += chunk.data();
      if (failures > 0 && upload.size() >= bytes_before_failure) {
        --failures;
        return kGone;
      }
    }
    status->set_committed_bytes(uploads[sha256].size());
    if (uploads[sha256].size() == declared_sizes[sha256]) {
      blobs[sha256] = uploads[sha256];
      status->set_complete(true);
    }
    return grpc::Status::OK;
  }

  grpc::Status ReadBlob(grpc::ServerContext*, const v1::ReadBlobRequest* request,
                        grpc::ServerWriter<v1::DataChunk>* writer) override {
    const std::lock_guard lock(mutex_);
    download_offsets.push_back(request->offset());
    const auto found = blobs.find(request->sha256());
    if (found == blobs.end()) {
      return {grpc::StatusCode::NOT_FOUND, "no such blob"};
    }
    constexpr size_t kChunk = 1 << 16;
    uint64_t sent = 0;
    for (size_t offset = request->offset(); offset < found->second.size(); offset += kChunk) {
      if (failures > 0 && sent >= bytes_before_failure) {
        --failures;
        return kGone;
      }
      v1::DataChunk chunk;
      chunk.set_data(found->second.substr(offset, kChunk));
      if (corrupt) {
        (*chunk.mutable_data())[0] ^= 1;
      }
      sent += chunk.data().size();
      writer->Write(chunk);
    }
    return grpc::Status::OK;
  }

 private:
  std::mutex mutex_;  // guards the maps and vectors while the server runs
};

class FakeJobs final : public v1::Jobs::Service {
 public:
  std::vector<v1::JobEvent> events;
  // Streams end with UNAVAILABLE after this many events each; 0: never.
  int events_per_stream = 0;
  // Streams stay open after the last event until the client leaves.
  bool endless = false;
  std::vector<uint64_t> watched_after;
  std::atomic<int> num_cancels{0};
  std::string withdrawn_request_id;  // of the last cancel; read it when no call runs

  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::JobEvent>* writer) override {
    watched_after.push_back(request->after_sequence());
    int sent = 0;
    for (const v1::JobEvent& event : events) {
      if (event.sequence() > request->after_sequence()) {
        if (events_per_stream > 0 && sent == events_per_stream) {
          return kGone;
        }
        writer->Write(event);
        ++sent;
      }
    }
    while (endless && !context->IsCancelled()) {
      gpr_sleep_until(gpr_time_add(gpr_now(GPR_CLOCK_MONOTONIC), gpr_time_from_millis(5, GPR_TIMESPAN)));
    }
    return grpc::Status::OK;
  }

  grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest*, v1::Job* job) override {
    *job = events.back().job();
    return grpc::Status::OK;
  }

  grpc::Status CancelJob(grpc::ServerContext*, const v1::CancelJobRequest* request, v1::Job* job) override {
    ++num_cancels;
    withdrawn_request_id = request->withdrawn_request_id();
    job->set_name(request->name());
    job->set_state(v1::Job::CANCELLED);
    return grpc::Status::OK;
  }
};

class FakeMaterials final : public v1::Materials::Service {
 public:
  std::atomic<int> failures{0};
  std::vector<std::string> request_ids;

  grpc::Status CreateMaterial(grpc::ServerContext*, const v1::CreateMaterialRequest* request,
                              v1::Material* material) override {
    request_ids.push_back(request->request_id());
    if (failures > 0) {
      --failures;
      return kGone;
    }
    material->set_name(request->name());
    return grpc::Status::OK;
  }

  grpc::Status GenerateMaterial(grpc::ServerContext*, const v1::GenerateMaterialRequest* request,
                                v1::Job* job) override {
    request_ids.push_back(request->request_id());
    job->set_name("jobs/1");
    return grpc::Status::OK;
  }

  // Three pages of two.
  grpc::Status ListMaterials(grpc::ServerContext*, const v1::ListMaterialsRequest* request,
                             v1::ListMaterialsResponse* response) override {
    const int page = request->page_token().empty() ? 0 : std::stoi(request->page_token());
    for (int i = 0; i < 2; ++i) {
      response->add_materials()->set_name("materials/m" + std::to_string(2 * page + i));
    }
    if (page < 2) {
      response->set_next_page_token(std::to_string(page + 1));
    }
    return grpc::Status::OK;
  }
};

// The three services on a free loopback port.
class FakeServer {
 public:
  FakeServer() {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    builder.RegisterService(&blobs);
    builder.RegisterService(&jobs);
    builder.RegisterService(&materials);
    server_ = builder.BuildAndStart();
  }
  ~FakeServer() { server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(1)); }

  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

  FakeBlobs blobs;
  FakeJobs jobs;
  FakeMaterials materials;

 private:
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace tessera
