// The whole server in this process, through a real socket.
#include "server/server.h"

#include <grpcpp/generic/generic_stub.h>
#include <gtest/gtest.h>

#include "btf/wang/arrangement.h"
#include "tests/server/support/server_fixture.h"

namespace tessera {
namespace {

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
