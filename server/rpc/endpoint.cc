// The only file of the server that reads the generated gRPC code: each RPC is handed to the function of its
// name.
#include "server/rpc/endpoint.h"

#include <memory>
#include <mutex>
#include <utility>

#include <grpcpp/alarm.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include <absl/strings/str_cat.h>

#include "proto/wire/status.h"
#include "server/rpc/arrangements.h"
#include "server/rpc/blobs.h"
#include "server/rpc/dressings.h"
#include "server/rpc/jobs.h"
#include "server/rpc/materials.h"
#include "server/rpc/previews.h"
#include "server/rpc/server_info.h"
#include "server/rpc/tile_sets.h"
#include "tessera/v1/tessera.grpc.pb.h"

namespace tessera {
namespace {

using grpc::ServerContext;

template <typename Response>
grpc::Status Answer(absl::StatusOr<Response> result, Response* response) {
  if (!result.ok()) {
    return GrpcFromStatus(result.status());
  }
  *response = *std::move(result);
  return grpc::Status::OK;
}

IsCancelled CancelledBy(ServerContext* context) {
  return [context] { return context->IsCancelled(); };
}

class MaterialsAdapter final : public v1::Materials::Service {
 public:
  explicit MaterialsAdapter(const Backend& backend) : service_(backend) {}
  grpc::Status CreateMaterial(ServerContext*, const v1::CreateMaterialRequest* request,
                              v1::Material* response) override {
    return Answer(service_.CreateMaterial(*request), response);
  }
  grpc::Status ImportMaterial(ServerContext*, const v1::ImportMaterialRequest* request,
                              v1::Job* response) override {
    return Answer(service_.ImportMaterial(*request), response);
  }
  grpc::Status GenerateMaterial(ServerContext*, const v1::GenerateMaterialRequest* request,
                                v1::Job* response) override {
    return Answer(service_.GenerateMaterial(*request), response);
  }
  grpc::Status GetMaterial(ServerContext*, const v1::GetMaterialRequest* request,
                           v1::Material* response) override {
    return Answer(service_.GetMaterial(*request), response);
  }
  grpc::Status ListMaterials(ServerContext*, const v1::ListMaterialsRequest* request,
                             v1::ListMaterialsResponse* response) override {
    return Answer(service_.ListMaterials(*request), response);
  }
  grpc::Status DeleteMaterial(ServerContext*, const v1::DeleteMaterialRequest* request,
                              v1::DeleteMaterialResponse* response) override {
    return Answer(service_.DeleteMaterial(*request), response);
  }

 private:
  MaterialsService service_;
};

class ArrangementsAdapter final : public v1::Arrangements::Service {
 public:
  grpc::Status GetArrangement(ServerContext*, const v1::GetArrangementRequest* request,
                              v1::Arrangement* response) override {
    return Answer(service_.GetArrangement(*request), response);
  }
  grpc::Status ListArrangements(ServerContext*, const v1::ListArrangementsRequest* request,
                                v1::ListArrangementsResponse* response) override {
    return Answer(service_.ListArrangements(*request), response);
  }

 private:
  ArrangementsService service_;
};

class TileSetsAdapter final : public v1::TileSets::Service {
 public:
  explicit TileSetsAdapter(const Backend& backend) : service_(backend) {}
  grpc::Status SynthesizeTileSet(ServerContext*, const v1::SynthesizeTileSetRequest* request,
                                 v1::Job* response) override {
    return Answer(service_.SynthesizeTileSet(*request), response);
  }
  grpc::Status CertifyTileSet(ServerContext*, const v1::CertifyTileSetRequest* request,
                              v1::Job* response) override {
    return Answer(service_.CertifyTileSet(*request), response);
  }
  grpc::Status CreateTileSet(ServerContext*, const v1::CreateTileSetRequest* request,
                             v1::TileSet* response) override {
    return Answer(service_.CreateTileSet(*request), response);
  }
  grpc::Status GetTileSet(ServerContext*, const v1::GetTileSetRequest* request,
                          v1::TileSet* response) override {
    return Answer(service_.GetTileSet(*request), response);
  }
  grpc::Status ListTileSets(ServerContext*, const v1::ListTileSetsRequest* request,
                            v1::ListTileSetsResponse* response) override {
    return Answer(service_.ListTileSets(*request), response);
  }
  grpc::Status DeleteTileSet(ServerContext*, const v1::DeleteTileSetRequest* request,
                             v1::DeleteTileSetResponse* response) override {
    return Answer(service_.DeleteTileSet(*request), response);
  }
  grpc::Status StreamTileSet(ServerContext* context, const v1::StreamTileSetRequest* request,
                             grpc::ServerWriter<v1::TileSetChunk>* writer) override {
    return GrpcFromStatus(
        service_.StreamTileSet(*request, CancelledBy(context),
                               [writer](const v1::TileSetChunk& chunk) { return writer->Write(chunk); }));
  }

 private:
  TileSetsService service_;
};

class DressingsAdapter final : public v1::Dressings::Service {
 public:
  explicit DressingsAdapter(const Backend& backend) : service_(backend) {}
  grpc::Status DressMesh(ServerContext* context, const v1::DressMeshRequest* request,
                         v1::DressMeshResponse* response) override {
    return Answer(service_.DressMesh(*request, CancelledBy(context)), response);
  }

 private:
  DressingsService service_;
};

class PreviewsAdapter final : public v1::Previews::Service {
 public:
  explicit PreviewsAdapter(const Backend& backend) : service_(backend) {}
  grpc::Status RenderPreview(ServerContext* context, const v1::RenderPreviewRequest* request,
                             grpc::ServerWriter<v1::RenderPreviewResponse>* writer) override {
    return GrpcFromStatus(service_.RenderPreview(
        *request, CancelledBy(context),
        [writer](const v1::RenderPreviewResponse& response) { return writer->Write(response); }));
  }

 private:
  PreviewsService service_;
};

class BlobsAdapter final : public v1::Blobs::Service {
 public:
  explicit BlobsAdapter(const Backend& backend) : service_(backend) {}
  grpc::Status BeginUpload(ServerContext*, const v1::BeginUploadRequest* request,
                           v1::UploadStatus* response) override {
    return Answer(service_.BeginUpload(*request), response);
  }
  grpc::Status WriteBlob(ServerContext*, grpc::ServerReader<v1::WriteChunk>* reader,
                         v1::UploadStatus* response) override {
    return Answer(service_.WriteBlob([reader](v1::WriteChunk& chunk) { return reader->Read(&chunk); }),
                  response);
  }
  grpc::Status ReadBlob(ServerContext*, const v1::ReadBlobRequest* request,
                        grpc::ServerWriter<v1::DataChunk>* writer) override {
    return GrpcFromStatus(
        service_.ReadBlob(*request, [writer](const v1::DataChunk& chunk) { return writer->Write(chunk); }));
  }

 private:
  BlobsService service_;
};

class ServerInfoAdapter final : public v1::ServerInfo::Service {
 public:
  ServerInfoAdapter(const Backend& backend, int num_workers) : service_(backend, num_workers) {}
  grpc::Status GetServerStatus(ServerContext*, const v1::GetServerStatusRequest* request,
                               v1::ServerStatus* response) override {
    return Answer(service_.GetServerStatus(*request), response);
  }

 private:
  ServerInfoService service_;
};

// One WatchJob stream. gRPC calls it, and so does whoever changes the job; it keeps itself alive until
// OnDone.
class WatchReactor final : public grpc::ServerWriteReactor<v1::JobEvent>,
                           public std::enable_shared_from_this<WatchReactor> {
 public:
  static WatchReactor* Begin(const JobsService& service, const v1::WatchJobRequest& request) {
    const auto reactor = std::make_shared<WatchReactor>();
    reactor->self_ = reactor;
    auto watch = service.WatchJob(request, [weak = std::weak_ptr<WatchReactor>(reactor)] {
      if (const auto alive = weak.lock()) {
        alive->Advance();
      }
    });
    if (watch.ok()) {
      {
        const std::lock_guard lock(reactor->mutex_);
        reactor->watch_ = *std::move(watch);
      }
      reactor->Advance();
    } else {
      reactor->FinishOnce(GrpcFromStatus(watch.status()));
    }
    return reactor.get();
  }

  void OnWriteDone(bool ok) override {
    bool gone = !ok;
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
      gone = gone || cancelled_;
    }
    if (gone) {
      FinishOnce(grpc::Status::CANCELLED);
    } else {
      Advance();
    }
  }
  void OnCancel() override {
    {
      const std::lock_guard lock(mutex_);
      cancelled_ = true;
      if (writing_) {
        return;  // OnWriteDone ends the stream
      }
    }
    FinishOnce(grpc::Status::CANCELLED);
  }
  void OnDone() override { self_.reset(); }

 private:
  // Starts the next write, or ends the stream after the last.
  void Advance() {
    bool write = false;
    absl::Status end;
    {
      const std::lock_guard lock(mutex_);
      if (writing_ || finished_ || watch_ == nullptr) {
        return;
      }
      JobWatch::News news = watch_->Next();
      if (!news.has_event && !news.ended) {
        return;
      }
      write = writing_ = news.has_event;
      event_ = std::move(news.event);
      end = std::move(news.error);
    }
    if (write) {
      StartWrite(&event_);
    } else {
      FinishOnce(GrpcFromStatus(end));
    }
  }
  void FinishOnce(const grpc::Status& status) {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(finished_, true)) {
        return;
      }
    }
    Finish(status);
  }

  std::shared_ptr<WatchReactor> self_;
  std::mutex mutex_;  // guards what follows; event_ belongs to the write while writing_
  std::shared_ptr<JobWatch> watch_;
  v1::JobEvent event_;
  bool writing_ = false;
  bool cancelled_ = false;
  bool finished_ = false;
};

// One WaitJob call; ends with the job, its time or its caller, whichever is first.
class WaitReactor final : public grpc::ServerUnaryReactor, public std::enable_shared_from_this<WaitReactor> {
 public:
  explicit WaitReactor(v1::Job* response) : response_(response) {}

  static WaitReactor* Begin(const JobsService& service, const v1::WaitJobRequest& request,
                            v1::Job* response) {
    const auto reactor = std::make_shared<WaitReactor>(response);
    reactor->self_ = reactor;
    const std::weak_ptr<WaitReactor> weak = reactor;
    const absl::StatusOr<int64_t> timeout_ms = JobsService::WaitTimeoutMs(request);
    if (!timeout_ms.ok()) {
      reactor->End(GrpcFromStatus(timeout_ms.status()), nullptr);
      return reactor.get();
    }
    v1::WatchJobRequest watch_request;
    watch_request.set_name(request.name());
    auto watch = service.WatchJob(watch_request, [weak] {
      if (const auto alive = weak.lock()) {
        alive->EndIfFinal();
      }
    });
    if (!watch.ok()) {
      reactor->End(GrpcFromStatus(watch.status()), nullptr);
      return reactor.get();
    }
    {
      const std::lock_guard lock(reactor->mutex_);
      reactor->watch_ = *std::move(watch);
    }
    reactor->alarm_.Set(std::chrono::system_clock::now() + std::chrono::milliseconds(*timeout_ms),
                        [weak](bool) {
                          if (const auto alive = weak.lock()) {
                            alive->End(grpc::Status::OK, alive->Watch());
                          }
                        });
    reactor->EndIfFinal();
    return reactor.get();
  }

  void OnCancel() override { End(grpc::Status::CANCELLED, nullptr); }
  void OnDone() override { self_.reset(); }

 private:
  std::shared_ptr<JobWatch> Watch() {
    const std::lock_guard lock(mutex_);
    return watch_;
  }
  void EndIfFinal() {
    const std::shared_ptr<JobWatch> watch = Watch();
    if (watch == nullptr) {
      return;
    }
    const absl::StatusOr<v1::JobEvent> latest = watch->Latest();
    if (!latest.ok() || IsFinal(latest->job().state())) {
      End(grpc::Status::OK, watch);
    }
  }
  // With a watch, answers what it knows.
  void End(grpc::Status status, const std::shared_ptr<JobWatch>& watch) {
    {
      const std::lock_guard lock(mutex_);
      if (std::exchange(finished_, true)) {
        return;
      }
    }
    if (watch != nullptr) {
      absl::StatusOr<v1::JobEvent> latest = watch->Latest();
      if (latest.ok()) {
        *response_ = std::move(*latest->mutable_job());
      } else {
        status = GrpcFromStatus(latest.status());
      }
    }
    Finish(status);
  }

  std::shared_ptr<WaitReactor> self_;
  v1::Job* const response_;
  grpc::Alarm alarm_;
  std::mutex mutex_;  // guards what follows
  std::shared_ptr<JobWatch> watch_;
  bool finished_ = false;
};

class JobsAdapter final
    : public v1::Jobs::WithCallbackMethod_WatchJob<v1::Jobs::WithCallbackMethod_WaitJob<v1::Jobs::Service>> {
 public:
  explicit JobsAdapter(const Backend& backend) : service_(backend) {}
  grpc::Status GetJob(ServerContext*, const v1::GetJobRequest* request, v1::Job* response) override {
    return Answer(service_.GetJob(*request), response);
  }
  grpc::Status ListJobs(ServerContext*, const v1::ListJobsRequest* request,
                        v1::ListJobsResponse* response) override {
    return Answer(service_.ListJobs(*request), response);
  }
  grpc::Status CancelJob(ServerContext*, const v1::CancelJobRequest* request, v1::Job* response) override {
    return Answer(service_.CancelJob(*request), response);
  }
  grpc::ServerWriteReactor<v1::JobEvent>* WatchJob(grpc::CallbackServerContext*,
                                                   const v1::WatchJobRequest* request) override {
    return WatchReactor::Begin(service_, *request);
  }
  grpc::ServerUnaryReactor* WaitJob(grpc::CallbackServerContext*, const v1::WaitJobRequest* request,
                                    v1::Job* response) override {
    return WaitReactor::Begin(service_, *request, response);
  }

 private:
  JobsService service_;
};

class GrpcEndpoint final : public Endpoint {
 public:
  GrpcEndpoint(const Backend& backend, int num_workers)
      : materials_(backend),
        tile_sets_(backend),
        jobs_(backend),
        dressings_(backend),
        previews_(backend),
        blobs_(backend),
        server_info_(backend, num_workers) {}
  ~GrpcEndpoint() override { Stop(std::chrono::milliseconds(0)); }

  absl::Status Listen(const std::string& listen) {
    grpc::EnableDefaultHealthCheckService(true);
    grpc::reflection::InitProtoReflectionServerBuilderPlugin();
    grpc::ServerBuilder builder;
    builder.AddListeningPort(listen, grpc::InsecureServerCredentials(), &port_);
    // Without this, two servers may share a port and calls go to either.
    builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
    builder.SetMaxReceiveMessageSize(kMaxRequestBytes);
    grpc::ResourceQuota quota("tessera");
    quota.SetMaxThreads(kMaxCallThreads);
    builder.SetResourceQuota(quota);
    for (grpc::Service* service :
         std::initializer_list<grpc::Service*>{&materials_, &arrangements_, &tile_sets_, &jobs_, &dressings_,
                                               &previews_, &blobs_, &server_info_}) {
      builder.RegisterService(service);
    }
    server_ = builder.BuildAndStart();
    if (server_ == nullptr || port_ == 0) {
      server_.reset();
      return absl::UnavailableError(
          absl::StrCat("cannot listen on ", listen, ": the address is taken or not ours"));
    }
    for (const char* service : {v1::Materials::service_full_name(), v1::Arrangements::service_full_name(),
                                v1::TileSets::service_full_name(), v1::Jobs::service_full_name(),
                                v1::Dressings::service_full_name(), v1::Previews::service_full_name(),
                                v1::Blobs::service_full_name(), v1::ServerInfo::service_full_name()}) {
      server_->GetHealthCheckService()->SetServingStatus(service, true);
    }
    return absl::OkStatus();
  }

  int port() const override { return port_; }

  void Stop(std::chrono::milliseconds grace) override {
    if (server_ != nullptr) {
      server_->GetHealthCheckService()->SetServingStatus(false);
      server_->Shutdown(std::chrono::system_clock::now() + grace);
      server_->Wait();
      server_.reset();
    }
  }

 private:
  MaterialsAdapter materials_;
  ArrangementsAdapter arrangements_;
  TileSetsAdapter tile_sets_;
  JobsAdapter jobs_;
  DressingsAdapter dressings_;
  PreviewsAdapter previews_;
  BlobsAdapter blobs_;
  ServerInfoAdapter server_info_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Endpoint>> Endpoint::Start(const std::string& listen, const Backend& backend,
                                                          int num_workers) {
  auto endpoint = std::make_unique<GrpcEndpoint>(backend, num_workers);
  if (absl::Status status = endpoint->Listen(listen); !status.ok()) {
    return status;
  }
  return endpoint;
}

}  // namespace tessera
