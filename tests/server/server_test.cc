// The whole server in this process, through a real socket.
#include "server/server.h"

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <thread>

#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include "btf/codec/material.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dressing.h"
#include "btf/wang/tile_set.h"
#include "proto/wire/convert.h"
#include "server/jobs/builtin_kinds.h"
#include "tests/server/support/open_catalog.h"
#include "tests/server/support/stubs.h"
#include "tests/support/btf_files.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr milliseconds kCancelLimit{1000};

Material TinyMaterial() {
  Material material;
  material.width = 2;
  material.height = 2;
  material.btfels.codec_id = "dsh-cls";
  material.btfels.codec_version = 1;
  material.btfels.num_coefficients = 3;
  material.btfels.offset = {0, 0, 0};
  material.btfels.step = {1, 1, 1};
  material.btfels.codes.assign(12, 7);
  material.btfels.parameters = {{"kl", 1}, {"kv", 1}};
  material.btfels.tables["basis_light"] = {{1, 1}, {1.0f}};
  material.btfels.tables["basis_view"] = {{1, 1}, {1.0f}};
  material.btfels.views = {{0, 0}};
  material.btfels.lights = {{0, 0}};
  material.provenance.licence = "CC0";
  return material;
}

// Seeds choose what the replaced kind "generate" does: 1 makes a material at once, 2 sleeps until it is
// stopped.
absl::StatusOr<JobOutput> FakeGenerate(const JobInput& input, const JobContext& context) {
  v1::GenerateMaterialRequest request;
  if (!request.ParseFromString(input.params)) {
    return absl::InternalError("params");
  }
  for (uint64_t i = 0; request.seed() == 2; ++i) {
    TESSERA_RETURN_IF_ERROR(context.run.CheckStop());
    context.run.Report("sleep", i, 0, "naps");
    std::this_thread::sleep_for(milliseconds(5));
  }
  const Material material = TinyMaterial();
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, SerializeMaterial(material));
  return JobOutput{std::move(bytes), MessageFromMaterial(material)};
}

class ServerTest : public testing::Test {
 protected:
  void SetUp() override {
    std::vector<JobKind> kinds = BuiltinJobKinds();
    for (JobKind& kind : kinds) {
      if (kind.name == "generate") {
        kind.run = &FakeGenerate;
      }
    }
    auto server = Server::Start({.data_folder = folder_.path(),
                                 .listen = "127.0.0.1:0",
                                 .num_workers = 2,
                                 .max_upload_bytes = kTestMaxUploadBytes,
                                 .job_kinds = std::move(kinds)});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    stubs_ = std::make_unique<Stubs>(server_->address());
  }
  void WaitForRun(const std::string& job) {
    for (int i = 0; i < 2000 && stubs_->GetJob(job)->state() != v1::Job::RUNNING; ++i) {
      std::this_thread::sleep_for(milliseconds(5));
    }
    ASSERT_EQ(stubs_->GetJob(job)->state(), v1::Job::RUNNING);
  }

  TempFolder folder_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<Stubs> stubs_;
};

TEST_F(ServerTest, BlobsGoUpAndComeDown) {
  const std::string bytes = TestBytes(3'500'000, 1);
  EXPECT_EQ(stubs_->Write(bytes, 0, 10).status().code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(stubs_->BeginUpload(bytes)->complete());
  // A stream that ends early keeps what it brought.
  EXPECT_EQ(stubs_->Write(bytes, 0, 1'200'000)->committed_bytes(), 1'200'000u);
  EXPECT_EQ(stubs_->BeginUpload(bytes)->committed_bytes(), 1'200'000u);
  EXPECT_EQ(ReasonOf(stubs_->Write(bytes, 2'000'000, 2'000'001).status()), "OFFSET_MISMATCH");
  EXPECT_TRUE(stubs_->Write(bytes, 1'200'000, bytes.size())->complete());
  EXPECT_TRUE(stubs_->BeginUpload(bytes)->complete());
  EXPECT_EQ(*stubs_->Download(DigestOf(bytes)), bytes);
  EXPECT_EQ(*stubs_->Download(DigestOf(bytes), 3'000'000), bytes.substr(3'000'000));
  EXPECT_EQ(stubs_->Download(DigestOf(bytes), bytes.size() + 1).status().code(),
            absl::StatusCode::kOutOfRange);
  EXPECT_EQ(ReasonOf(stubs_->Download(std::string(64, 'a')).status()), "BLOB_MISSING");
}

TEST_F(ServerTest, AnUploadThatBreaksOffKeepsWhatCameThrough) {
  const std::string bytes = TestBytes(5'000'000, 2);
  ASSERT_TRUE(stubs_->BeginUpload(bytes).ok());
  {
    grpc::ClientContext context;
    v1::UploadStatus response;
    auto writer = stubs_->blobs->WriteBlob(&context, &response);
    v1::WriteChunk chunk;
    chunk.set_sha256(DigestOf(bytes));
    for (uint64_t offset = 0; offset < 3 << 20; offset += 1 << 20) {
      chunk.set_offset(offset);
      chunk.set_data(bytes.substr(offset, 1 << 20));
      ASSERT_TRUE(writer->Write(chunk));
    }
    const auto uploading = folder_.path() / "uploads" / DigestOf(bytes);
    for (int i = 0; i < 4000; ++i) {  // until something came through
      std::error_code error;
      if (std::filesystem::file_size(uploading, error) > 0 && !error) {
        break;
      }
      std::this_thread::sleep_for(milliseconds(5));
    }
    context.TryCancel();
    EXPECT_FALSE(writer->Finish().ok());
  }
  uint64_t committed = 0;
  for (int i = 0; i < 2000 && committed == 0; ++i) {  // the server notices the break a moment later
    std::this_thread::sleep_for(milliseconds(10));
    committed = stubs_->BeginUpload(bytes)->committed_bytes();
  }
  EXPECT_GT(committed, 0u);
  EXPECT_TRUE(stubs_->Write(bytes, committed, bytes.size())->complete());
}

TEST_F(ServerTest, TwoClientsUploadTheSameBlobAtOnce) {
  const std::string bytes = TestBytes(20'000'000, 3);
  ASSERT_TRUE(stubs_->BeginUpload(bytes).ok());
  std::atomic<int> num_complete = 0;
  {
    std::vector<std::jthread> clients;
    for (int i = 0; i < 2; ++i) {
      clients.emplace_back([&] {
        const auto done = Stubs(server_->address()).Write(bytes, 0, bytes.size());
        EXPECT_TRUE(done.ok()) << done.status();
        num_complete += done.ok() && done->complete() ? 1 : 0;
      });
    }
  }
  EXPECT_EQ(num_complete, 2);
  EXPECT_EQ(*stubs_->Download(DigestOf(bytes)), bytes);
}

TEST_F(ServerTest, UploadsOfTheWrongBytesAreRefused) {
  const std::string promised = TestBytes(1000, 4);
  ASSERT_TRUE(stubs_->BeginUpload(promised).ok());
  grpc::ClientContext context;
  v1::UploadStatus response;
  auto writer = stubs_->blobs->WriteBlob(&context, &response);
  v1::WriteChunk chunk;
  chunk.set_sha256(DigestOf(promised));
  chunk.set_data(TestBytes(1000, 5));
  writer->Write(chunk);
  writer->WritesDone();
  EXPECT_EQ(ReasonOf(StatusFromGrpc(writer->Finish())), "DIGEST_MISMATCH");

  v1::BeginUploadRequest too_large;
  too_large.set_sha256(std::string(64, 'a'));
  too_large.set_size_bytes(kTestMaxUploadBytes + 1);
  EXPECT_EQ(ReasonOf(Stubs::Call(&v1::Blobs::Stub::BeginUpload, *stubs_->blobs, too_large).status()),
            "UPLOAD_TOO_LARGE");
}

TEST_F(ServerTest, OnlyContainersBecomeMaterials) {
  const auto bytes = SerializeMaterial(TinyMaterial());
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  v1::CreateMaterialRequest request;
  request.set_name("materials/tiny");
  request.set_blob_sha256(stubs_->Upload("no container at all"));
  const auto create = [&] {
    return Stubs::Call(&v1::Materials::Stub::CreateMaterial, *stubs_->materials, request);
  };
  EXPECT_EQ(ReasonOf(create().status()), "FORMAT_INVALID");
  request.set_blob_sha256(DigestOf(*bytes));
  EXPECT_EQ(ReasonOf(create().status()), "BLOB_MISSING");
  stubs_->Upload(*bytes);
  const auto created = create();
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->width(), 2u);
  EXPECT_EQ(created->num_coefficients(), 3u);
  EXPECT_EQ(created->provenance().licence(), "CC0");
  EXPECT_EQ(created->blob().size_bytes(), bytes->size());
  EXPECT_EQ(ReasonOf(create().status()), "NAME_TAKEN");
  request.set_replace(true);
  EXPECT_TRUE(create().ok());
  request.set_name("materials/Tiny");
  EXPECT_EQ(ReasonOf(create().status()), "NAME_INVALID");

  v1::CreateTileSetRequest as_tile_set;
  as_tile_set.set_name("arrangements/plane-16/tileSets/tiny");
  as_tile_set.set_blob_sha256(DigestOf(*bytes));
  EXPECT_EQ(
      ReasonOf(Stubs::Call(&v1::TileSets::Stub::CreateTileSet, *stubs_->tile_sets, as_tile_set).status()),
      "FORMAT_INVALID");
}

TEST_F(ServerTest, ARepeatedRequestIsAnsweredAgainAndDoneOnce) {
  v1::GenerateMaterialRequest request = Stubs::SmallMaterial("a");
  request.set_request_id("11111111-2222");
  const auto first = stubs_->Generate(request);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_EQ(stubs_->Wait(first->name())->state(), v1::Job::SUCCEEDED);
  const auto again = stubs_->Generate(request);  // the name is taken by now
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->name(), first->name());
  request.set_size(64);
  EXPECT_EQ(stubs_->Generate(request).status().code(), absl::StatusCode::kInvalidArgument);

  v1::DeleteMaterialRequest remove;
  remove.set_name("materials/a");
  remove.set_request_id("delete");
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(Stubs::Call(&v1::Materials::Stub::DeleteMaterial, *stubs_->materials, remove).ok());
  }
  remove.set_request_id("another");
  EXPECT_EQ(ReasonOf(Stubs::Call(&v1::Materials::Stub::DeleteMaterial, *stubs_->materials, remove).status()),
            "NOT_FOUND");
}

TEST_F(ServerTest, WrongArgumentsAreRefusedBeforeAnyJob) {
  const auto reason_of = [&](const std::function<void(v1::GenerateMaterialRequest&)>& change) {
    v1::GenerateMaterialRequest request = Stubs::SmallMaterial("a");
    change(request);
    return ReasonOf(stubs_->Generate(request).status());
  };
  EXPECT_EQ(reason_of([](auto& request) { request.set_kind("velvet"); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_kind("heightmap"); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_lights("many"); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_size(16); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_size(100000); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.mutable_encode()->set_codec("jpeg"); }),
            "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_name("materials/a/b"); }), "NAME_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_request_id(std::string(129, 'x')); }),
            "ARGUMENT_INVALID");

  v1::SynthesizeTileSetRequest synthesis;
  synthesis.set_material("materials/none");
  synthesis.set_name("arrangements/plane-16/tileSets/");
  const auto synthesize = [&] {
    return ReasonOf(
        Stubs::Call(&v1::TileSets::Stub::SynthesizeTileSet, *stubs_->tile_sets, synthesis).status());
  };
  EXPECT_EQ(synthesize(), "NOT_FOUND");
  synthesis.set_strip_height(7);
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID");
  synthesis.set_strip_height(40);
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID");
  synthesis.set_name("arrangements/nowhere/tileSets/");
  EXPECT_EQ(synthesize(), "NOT_FOUND");

  v1::ImportMaterialRequest import;
  import.set_name("materials/a");
  import.set_archive_sha256(std::string(64, 'a'));
  const auto import_reason = [&] {
    return ReasonOf(Stubs::Call(&v1::Materials::Stub::ImportMaterial, *stubs_->materials, import).status());
  };
  EXPECT_EQ(import_reason(), "BLOB_MISSING");
  import.set_transfer("gamma:-1");
  EXPECT_EQ(import_reason(), "ARGUMENT_INVALID");
}

TEST_F(ServerTest, AnArchiveThatIsNoneFailsItsJobWithoutShowingPaths) {
  v1::ImportMaterialRequest request;
  request.set_name("materials/a");
  request.set_archive_sha256(stubs_->Upload("neither zip nor exr"));
  const auto job = Stubs::Call(&v1::Materials::Stub::ImportMaterial, *stubs_->materials, request);
  ASSERT_TRUE(job.ok()) << job.status();
  const auto ended = stubs_->Wait(job->name());
  EXPECT_EQ(ended->state(), v1::Job::FAILED);
  EXPECT_NE(ended->error().message(), "");
  EXPECT_EQ(ended->error().message().find(folder_.path().string()), std::string::npos)
      << ended->error().message();
}

TEST_F(ServerTest, UploadedArchivesBecomeMaterials) {
  const auto btf = AsymmetricBtf(8, 6, WholeDegreeDirections(2, 3), WholeDegreeDirections(2, 4));
  const TempFolder scratch;
  FileMap files = Ubo2003Files(*btf, TestImageKind::kPng8, "");
  const auto zip_of = [&](const std::string& name) {
    WriteZip(files, scratch.path() / name, ZipPacking::kDeflated);
    std::ifstream file(scratch.path() / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  v1::ImportMaterialRequest request;
  request.mutable_encode()->set_kl(4);
  request.mutable_encode()->set_kv(4);
  request.mutable_provenance()->set_licence("CC0");
  const auto import = [&](const std::string& name, const std::string& bytes) -> v1::Job {
    request.set_name("materials/" + name);
    request.set_archive_sha256(stubs_->Upload(bytes));
    const auto job = Stubs::Call(&v1::Materials::Stub::ImportMaterial, *stubs_->materials, request);
    EXPECT_TRUE(job.ok()) << job.status();
    return *stubs_->Wait(job->name());
  };
  for (const auto& [name, bytes] :
       FileMap{{"zip", zip_of("a.zip")}, {"exr", MultiPartExr(*btf, ExrPartKind::kHalf)}}) {
    const v1::Job job = import(name, bytes);
    ASSERT_EQ(job.state(), v1::Job::SUCCEEDED) << job.DebugString();
    const auto material = stubs_->GetMaterial(name);
    EXPECT_EQ(material->width(), 8u);
    EXPECT_EQ(material->height(), 6u);
    EXPECT_EQ(material->num_views(), btf->info().views.size());
    EXPECT_EQ(material->num_lights(), btf->info().lights.size());
    EXPECT_EQ(material->provenance().licence(), "CC0");
    const auto container = stubs_->Download(material->blob().sha256());
    EXPECT_TRUE(ParseMaterial(std::as_bytes(std::span(*container))).ok());
  }
  files.erase(files.begin());
  const v1::Job job = import("incomplete", zip_of("b.zip"));
  EXPECT_EQ(job.state(), v1::Job::FAILED);
  EXPECT_EQ(job.error().detail().reason(), "ARGUMENT_INVALID") << job.DebugString();
  EXPECT_EQ(job.error().message().find(folder_.path().string()), std::string::npos) << job.error().message();
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path() / "scratch"));
}

TEST_F(ServerTest, AWatchFollowsAJobAndResumes) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  WaitForRun(job->name());
  grpc::ClientContext context;
  v1::WatchJobRequest request;
  request.set_name(job->name());
  auto reader = stubs_->jobs->WatchJob(&context, request);
  v1::JobEvent event;
  uint64_t sequence = 0;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(reader->Read(&event));
    EXPECT_GT(event.sequence(), sequence);
    sequence = event.sequence();
  }
  EXPECT_EQ(event.job().progress().stage(), "sleep");

  grpc::ClientContext resumed_context;
  request.set_after_sequence(sequence);
  auto resumed = stubs_->jobs->WatchJob(&resumed_context, request);
  ASSERT_TRUE(stubs_->Cancel(job->name()).ok());
  while (resumed->Read(&event)) {
    EXPECT_GT(event.sequence(), sequence);
    sequence = event.sequence();
  }
  EXPECT_TRUE(resumed->Finish().ok());
  EXPECT_EQ(event.job().state(), v1::Job::CANCELLED);
  while (reader->Read(&event)) {
  }
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(event.job().state(), v1::Job::CANCELLED);

  grpc::ClientContext late_context;  // everything was told: the stream ends at once
  request.set_after_sequence(sequence);
  auto late = stubs_->jobs->WatchJob(&late_context, request);
  EXPECT_FALSE(late->Read(&event));
  EXPECT_TRUE(late->Finish().ok());

  grpc::ClientContext unknown_context;
  request.set_name("jobs/99");
  auto unknown = stubs_->jobs->WatchJob(&unknown_context, request);
  EXPECT_FALSE(unknown->Read(&event));
  EXPECT_EQ(ReasonOf(StatusFromGrpc(unknown->Finish())), "NOT_FOUND");
}

TEST_F(ServerTest, ManyWatchersTakeNoThreads) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  v1::WatchJobRequest request;
  request.set_name(job->name());
  constexpr int kWatchers = 300;  // more than the server has threads
  std::vector<std::unique_ptr<grpc::ClientContext>> contexts;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> readers;
  v1::JobEvent event;
  for (int i = 0; i < kWatchers; ++i) {
    contexts.push_back(std::make_unique<grpc::ClientContext>());
    readers.push_back(stubs_->jobs->WatchJob(contexts.back().get(), request));
    ASSERT_TRUE(readers.back()->Read(&event)) << i;
  }
  const auto start = steady_clock::now();
  EXPECT_TRUE(stubs_->Cancel(job->name()).ok());
  EXPECT_LT(steady_clock::now() - start, kCancelLimit);
  for (auto& reader : readers) {
    while (reader->Read(&event)) {
    }
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(event.job().state(), v1::Job::CANCELLED);
  }
}

TEST_F(ServerTest, WaitsEndWithTheJobOrTheirTime) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  const auto start = steady_clock::now();
  const auto waited = stubs_->Wait(job->name(), 50);
  ASSERT_TRUE(waited.ok()) << waited.status();
  EXPECT_FALSE(waited->state() == v1::Job::CANCELLED);
  EXPECT_GE(steady_clock::now() - start, milliseconds(50));
  std::jthread canceller([&] {
    std::this_thread::sleep_for(milliseconds(100));
    EXPECT_TRUE(stubs_->Cancel(job->name()).ok());
  });
  EXPECT_EQ(stubs_->Wait(job->name())->state(), v1::Job::CANCELLED);
  EXPECT_EQ(stubs_->Wait(job->name(), 600'001).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(ReasonOf(stubs_->Wait("jobs/99").status()), "NOT_FOUND");
}

TEST_F(ServerTest, ACancelEndsAJobWithinASecond) {
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  WaitForRun(job->name());
  const auto start = steady_clock::now();
  ASSERT_TRUE(stubs_->Cancel(job->name()).ok());
  EXPECT_EQ(stubs_->Wait(job->name())->state(), v1::Job::CANCELLED);
  EXPECT_LT(steady_clock::now() - start, kCancelLimit);
  EXPECT_EQ(stubs_->Cancel(job->name())->state(), v1::Job::CANCELLED);
}

TEST_F(ServerTest, TwoClientsRaceForOneName) {
  std::atomic<int> num_made = 0;
  std::atomic<int> num_taken = 0;
  {
    std::vector<std::jthread> clients;
    for (uint64_t i = 0; i < 2; ++i) {
      clients.emplace_back([&, i] {
        const Stubs stubs(server_->address());
        const auto job = stubs.Generate(Stubs::SmallMaterial("a", 3 + i));
        num_made += job.ok() ? 1 : 0;
        num_taken += ReasonOf(job.status()) == "NAME_TAKEN" ? 1 : 0;
      });
    }
  }
  EXPECT_EQ(num_made, 1);
  EXPECT_EQ(num_taken, 1);
}

TEST_F(ServerTest, ListsComeInPages) {
  for (const char* name : {"c", "a", "b"}) {
    const auto job = stubs_->Generate(Stubs::SmallMaterial(name));
    ASSERT_EQ(stubs_->Wait(job->name())->state(), v1::Job::SUCCEEDED);
  }
  v1::ListMaterialsRequest request;
  request.set_page_size(2);
  const auto list = [&] {
    return Stubs::Call(&v1::Materials::Stub::ListMaterials, *stubs_->materials, request);
  };
  const auto first = list();
  ASSERT_EQ(first->materials_size(), 2);
  EXPECT_EQ(first->materials(0).name(), "materials/a");
  request.set_page_token(first->next_page_token());
  const auto second = list();
  ASSERT_EQ(second->materials_size(), 1);
  EXPECT_EQ(second->materials(0).name(), "materials/c");
  EXPECT_EQ(second->next_page_token(), "");
  request.set_page_token("x");
  EXPECT_EQ(list().status().code(), absl::StatusCode::kInvalidArgument);
  const auto jobs = Stubs::Call(&v1::Jobs::Stub::ListJobs, *stubs_->jobs, v1::ListJobsRequest());
  EXPECT_EQ(jobs->jobs_size(), 3);
}

TEST_F(ServerTest, ArrangementsAreTheBuiltInOnes) {
  const auto list = Stubs::Call(&v1::Arrangements::Stub::ListArrangements, *stubs_->arrangements,
                                v1::ListArrangementsRequest());
  ASSERT_TRUE(list.ok());
  ASSERT_EQ(list->arrangements_size(), static_cast<int>(BuiltinArrangements().size()));
  for (const auto& message : list->arrangements()) {
    EXPECT_TRUE(ArrangementFromMessage(message).ok());
  }
  v1::GetArrangementRequest request;
  request.set_name("arrangements/surface-96");
  EXPECT_EQ(
      Stubs::Call(&v1::Arrangements::Stub::GetArrangement, *stubs_->arrangements, request)->tile_codes_size(),
      96);
  request.set_name("arrangements/surface-97");
  EXPECT_EQ(
      ReasonOf(Stubs::Call(&v1::Arrangements::Stub::GetArrangement, *stubs_->arrangements, request).status()),
      "NOT_FOUND");
}

TEST_F(ServerTest, MessagesAreBounded) {
  v1::WriteChunk chunk;
  chunk.set_sha256(std::string(64, 'a'));
  const std::string bytes = TestBytes(3 << 20, 1);
  ASSERT_TRUE(stubs_->BeginUpload(bytes).ok());
  const auto write = [&](size_t size) {
    grpc::ClientContext context;
    v1::UploadStatus response;
    auto writer = stubs_->blobs->WriteBlob(&context, &response);
    v1::WriteChunk large;
    large.set_sha256(DigestOf(bytes));
    large.set_data(std::string(size, 'x'));
    writer->Write(large);
    writer->WritesDone();
    return StatusFromGrpc(writer->Finish());
  };
  EXPECT_EQ(ReasonOf(write((1 << 20) + 1)), "ARGUMENT_INVALID");
  EXPECT_FALSE(write(5 << 20).ok());
}

TEST_F(ServerTest, TheStatusCounts) {
  stubs_->Upload(TestBytes(1000, 1));
  const auto job = stubs_->Generate(Stubs::SmallMaterial("a", 2));
  WaitForRun(job->name());
  const auto status =
      Stubs::Call(&v1::ServerInfo::Stub::GetServerStatus, *stubs_->server_info, v1::GetServerStatusRequest());
  ASSERT_TRUE(status.ok()) << status.status();
  EXPECT_EQ(status->num_workers(), 2u);
  EXPECT_EQ(status->num_running_jobs(), 1u);
  EXPECT_EQ(status->blob_bytes(), 1000u);
  EXPECT_NE(status->version(), "");
}

// One message there and one back, as bytes: Debian ships no generated code for health and reflection.
std::string CallWithBytes(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                          const std::string& request) {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  const auto next = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  auto call = stub.PrepareCall(&context, method, &queue);
  call->StartCall(nullptr);
  EXPECT_TRUE(next());
  const grpc::Slice slice(request);
  call->Write(grpc::ByteBuffer(&slice, 1), nullptr);
  EXPECT_TRUE(next());
  grpc::ByteBuffer response;
  call->Read(&response, nullptr);
  EXPECT_TRUE(next()) << method;
  call->WritesDone(nullptr);
  next();
  grpc::Status status;
  call->Finish(&status, nullptr);
  next();
  EXPECT_TRUE(status.ok()) << method << ": " << status.error_message();
  std::vector<grpc::Slice> slices;
  response.Dump(&slices).ok();
  std::string bytes;
  for (const grpc::Slice& part : slices) {
    bytes.append(reinterpret_cast<const char*>(part.begin()), part.size());
  }
  return bytes;
}

TEST_F(ServerTest, HealthAndReflectionAnswer) {
  const std::string serving("\x08\x01", 2);  // HealthCheckResponse.status = SERVING
  EXPECT_EQ(CallWithBytes(stubs_->channel, "/grpc.health.v1.Health/Check", ""), serving);
  const std::string service = "tessera.v1.Materials";
  EXPECT_EQ(CallWithBytes(stubs_->channel, "/grpc.health.v1.Health/Check",
                          std::string("\x0a") + static_cast<char>(service.size()) + service),
            serving);
  // ServerReflectionRequest.list_services = "*"
  const std::string services = CallWithBytes(
      stubs_->channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", "\x3a\x01*");
  for (const char* name :
       {"Materials", "Arrangements", "TileSets", "Jobs", "Dressings", "Previews", "Blobs", "ServerInfo"}) {
    EXPECT_NE(services.find(std::string("tessera.v1.") + name), std::string::npos) << name;
  }
}

TEST_F(ServerTest, MeshesAreDressedAndKept) {
  v1::DressMeshRequest request;
  request.set_arrangement("arrangements/surface-96");
  request.set_builtin("torus");
  request.set_seed(5);
  const auto dress = [&] {
    return Stubs::Call(&v1::Dressings::Stub::DressMesh, *stubs_->dressings, request);
  };
  const auto torus = dress();
  ASSERT_TRUE(torus.ok()) << torus.status();
  EXPECT_EQ(torus->num_breaks(), 0u);
  const auto bytes = stubs_->Download(torus->dressing().sha256());
  const auto dressing = ParseDressing(std::as_bytes(std::span(*bytes)));
  ASSERT_TRUE(dressing.ok()) << dressing.status();
  EXPECT_EQ(dressing->mesh.quads.size(), torus->num_quads());
  EXPECT_EQ(dress()->dressing().sha256(), torus->dressing().sha256());

  request.set_mesh_sha256(stubs_->Upload("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"));
  EXPECT_TRUE(dress().ok()) << dress().status();
  request.set_mesh_sha256(stubs_->Upload("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"));
  EXPECT_TRUE(dress().ok()) << dress().status();
  request.set_mesh_sha256(stubs_->Upload("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"));
  EXPECT_EQ(ReasonOf(dress().status()), "FORMAT_INVALID");
  request.set_builtin("teapot");
  EXPECT_EQ(ReasonOf(dress().status()), "NOT_FOUND");
  request.clear_mesh();
  EXPECT_EQ(SubjectOf(dress().status()), "mesh");
}

// Every texel of every tile shows the one BTFel of the tiny material.
TileSet TinyTileSet() {
  const Material material = TinyMaterial();
  const Arrangement* arrangement = *FindArrangement("surface-96");
  TileSet tile_set;
  tile_set.arrangement_id = arrangement->id;
  tile_set.arrangement_sha256 = arrangement->sha256;
  tile_set.tile_size = 16;
  tile_set.strip_height = 8;
  tile_set.tile_codes = arrangement->codes;
  tile_set.tile_index.assign(arrangement->codes.size() * 16 * 16, 0);
  tile_set.btfels = material.btfels;
  tile_set.btfels.codes.resize(3);
  return tile_set;
}

TEST_F(ServerTest, PicturesAreDrawn) {
  const auto bytes = SerializeTileSet(TinyTileSet());
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  v1::CreateTileSetRequest create;
  create.set_blob_sha256(stubs_->Upload(*bytes));
  create.set_name("arrangements/plane-16/tileSets/tiny");
  const auto create_tile_set = [&] {
    return Stubs::Call(&v1::TileSets::Stub::CreateTileSet, *stubs_->tile_sets, create);
  };
  EXPECT_EQ(ReasonOf(create_tile_set().status()), "ARRANGEMENT_MISMATCH");
  create.set_name("arrangements/surface-96/tileSets/tiny");
  const auto created = create_tile_set();
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->num_tiles(), 96u);

  v1::RenderPreviewRequest request;
  request.set_tile_set(create.name());
  request.set_builtin("cube-sphere");
  request.set_width(64);
  request.set_height(48);
  const auto render = [&]() -> absl::StatusOr<std::string> {
    grpc::ClientContext context;
    auto reader = stubs_->previews->RenderPreview(&context, request);
    std::string picture;
    for (v1::DataChunk chunk; reader->Read(&chunk);) {
      picture += chunk.data();
    }
    const grpc::Status status = reader->Finish();
    if (!status.ok()) {
      return StatusFromGrpc(status);
    }
    return picture;
  };
  const auto png = render();
  ASSERT_TRUE(png.ok()) << png.status();
  EXPECT_EQ(png->substr(1, 3), "PNG");
  EXPECT_EQ(*render(), *png);
  request.set_format(v1::RenderPreviewRequest::EXR);
  EXPECT_EQ(render()->substr(0, 4), "\x76\x2f\x31\x01");

  v1::DressMeshRequest dress;
  dress.set_arrangement("arrangements/plane-16");
  dress.set_builtin("plane");
  const auto plane = Stubs::Call(&v1::Dressings::Stub::DressMesh, *stubs_->dressings, dress);
  ASSERT_TRUE(plane.ok()) << plane.status();
  request.set_dressing_sha256(plane->dressing().sha256());
  EXPECT_EQ(ReasonOf(render().status()), "ARRANGEMENT_MISMATCH");
  request.set_width(5000);
  EXPECT_EQ(SubjectOf(render().status()), "width");
  request.set_width(64);
  request.set_tile_set("arrangements/surface-96/tileSets/none");
  EXPECT_EQ(ReasonOf(render().status()), "NOT_FOUND");
}

TEST_F(ServerTest, OneServerPerFolderAndPort) {
  const auto same_folder = Server::Start({.data_folder = folder_.path(), .listen = "127.0.0.1:0"});
  EXPECT_EQ(same_folder.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(same_folder.status().message().find("another tessera-server"), absl::string_view::npos);
  TempFolder other;
  EXPECT_EQ(Server::Start({.data_folder = other.path(), .listen = server_->address()}).status().code(),
            absl::StatusCode::kUnavailable);
  server_->Stop();
  server_->Stop();
  EXPECT_TRUE(Server::Start({.data_folder = folder_.path(), .listen = "127.0.0.1:0"}).ok());
}

TEST_F(ServerTest, AnOpenAddressNeedsAWord) {
  TempFolder other;
  EXPECT_EQ(Server::Start({.data_folder = other.path(), .listen = "0.0.0.0:0"}).status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(Server::Start({.data_folder = other.path(), .listen = "0.0.0.0:0", .insecure = true}).ok());
}

}  // namespace
}  // namespace tessera
