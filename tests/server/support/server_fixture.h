// A whole server in this process, reached through a real socket, with jobs that a test can hold.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "btf/codec/material.h"
#include "proto/wire/convert.h"
#include "server/jobs/builtin_kinds.h"
#include "server/server.h"
#include "tests/server/support/open_catalog.h"
#include "tests/server/support/stubs.h"
#include "tests/support/temp_folder.h"

namespace tessera {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

inline Material TinyMaterial() {
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
inline absl::StatusOr<JobOutput> FakeGenerate(const JobInput& input, const JobContext& context) {
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

}  // namespace tessera
