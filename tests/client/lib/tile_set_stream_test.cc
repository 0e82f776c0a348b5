// Client::StreamTileSet against the real server, and against one that lies.
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include "btf/base/atomic_file.h"
#include "btf/base/reason.h"
#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/wang/tile_set_parts.h"
#include "client/lib/client.h"
#include "server/server.h"
#include "tessera/v1/tessera.grpc.pb.h"
#include "tests/btf/render/hand_made.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr char kName[] = "arrangements/surface-96/tileSets/random";

TileSet RandomSet(uint64_t seed = 1) {
  TileSet tile_set = testing::RandomTileSet(testing::RandomBtfels(200, 9, 9, seed), 8, seed);
  tile_set.strip_height = 8;
  tile_set.metadata["exemplar"] = {{"width", 20}};
  for (uint32_t pixel = 0; pixel < 200; ++pixel) {
    tile_set.source_pixels.push_back(pixel);
  }
  return tile_set;
}

class TileSetStreamTest : public ::testing::Test {
 protected:
  void SetUp() override {
    StartServer();
    client_ = Connect(0);
    ASSERT_TRUE(Create(RandomSet()).ok());
  }
  void StartServer() {
    server_.reset();
    auto server =
        Server::Start({.data_folder = folder_.path() / "data", .listen = "127.0.0.1:0", .num_workers = 1});
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }
  [[nodiscard]] std::unique_ptr<Client> Connect(uint64_t cache_limit_bytes) const {
    auto client = Client::Connect({.address = std::string(server_->address()),
                                   .cache_folder = folder_.path() / "cache",
                                   .cache_limit_bytes = cache_limit_bytes});
    EXPECT_TRUE(client.ok()) << client.status();
    return *std::move(client);
  }
  absl::Status Create(const TileSet& tile_set) {
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, SerializeTileSet(tile_set));
    TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client_->UploadBytes(std::as_bytes(std::span(bytes))));
    v1::CreateTileSetRequest request;
    request.set_name(kName);
    request.set_blob_sha256(blob.sha256());
    request.set_replace(true);
    return client_->CreateTileSet(request).status();
  }
  [[nodiscard]] StreamedTileSet Stream(const SceneNeeds& needs, const OnPart& on_part = {}) {
    auto streamed = client_->StreamTileSet(kName, needs, on_part);
    EXPECT_TRUE(streamed.ok()) << streamed.status();
    return streamed.ok() ? *std::move(streamed) : StreamedTileSet{};
  }
  [[nodiscard]] std::vector<fs::path> CachedFiles() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_.path() / "cache" / "blobs")) {
      if (entry.is_regular_file()) {
        files.push_back(entry.path());
      }
    }
    return files;
  }

  TempFolder folder_;
  std::unique_ptr<Server> server_;
  std::unique_ptr<Client> client_;
};

TEST_F(TileSetStreamTest, EveryPartIsAPlaceToStop) {
  const TileSet tile_set = RandomSet();
  const int num_parts = Stream({}).progress.plan.parts_size();
  ASSERT_GE(num_parts, 5);
  double last = INFINITY;
  for (int stop = 1; stop <= num_parts; ++stop) {
    fs::remove_all(folder_.path() / "cache");
    int calls = 0;
    const StreamedTileSet streamed = Stream({}, [&](const TileSet& so_far, const StreamProgress& progress) {
      EXPECT_EQ(progress.num_parts, static_cast<size_t>(++calls));
      EXPECT_EQ(so_far.btfels.size(), tile_set.btfels.size());
      return calls == stop ? AfterPart::kStop : AfterPart::kGoOn;
    });
    EXPECT_EQ(calls, stop);
    EXPECT_EQ(streamed.progress.is_all(), stop == num_parts);
    EXPECT_LT(streamed.progress.rmse(), last);
    last = streamed.progress.rmse();
    const auto bytes = SerializeTileSet(streamed.tile_set);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    EXPECT_TRUE(ParseTileSet(std::as_bytes(std::span(*bytes))).ok());
  }
  EXPECT_EQ(last, 0.0);
  const StreamedTileSet whole = Stream({});
  EXPECT_EQ(whole.tile_set.tile_index, tile_set.tile_index);
  EXPECT_EQ(whole.tile_set.btfels.codes, tile_set.btfels.codes);
}

TEST_F(TileSetStreamTest, OnlyWhatIsNeededMoves) {
  const StreamedTileSet whole = Stream({});
  const StreamedTileSet some = Stream({.tiles = {90, 3, 3}, .max_error = 0.02});
  EXPECT_EQ(some.progress.plan.num_tiles(), 2u);
  EXPECT_LE(some.progress.rmse(), 0.02);
  EXPECT_LT(some.progress.part_bytes, whole.progress.part_bytes);
  const uint64_t limit = whole.progress.part_bytes / 3;
  const StreamedTileSet bounded = Stream({.max_bytes = limit});
  EXPECT_LE(bounded.progress.part_bytes, limit);
  EXPECT_TRUE(bounded.progress.is_all());
  EXPECT_GT(bounded.progress.rmse(), 0.0);
  const StreamedTileSet far = Stream({.level = 3, .light = SceneLight::kEnvironment});
  EXPECT_EQ(far.tile_set.tile_size, 4);
  EXPECT_LE(far.progress.rmse(), 0.006);
  EXPECT_LT(far.progress.part_bytes, whole.progress.part_bytes);
  EXPECT_THAT(far.progress.plan.directions(), HasSubstr("soft lights"));
}

TEST_F(TileSetStreamTest, WhatTheCacheHasIsNotMovedAgainNotEvenAfterARestart) {
  const StreamedTileSet first = Stream({});
  EXPECT_GT(first.progress.moved_bytes, first.progress.part_bytes);
  StartServer();
  client_ = Connect(0);
  const StreamedTileSet again = Stream({});
  EXPECT_EQ(again.tile_set.btfels.codes, first.tile_set.btfels.codes);
  EXPECT_EQ(again.progress.part_bytes, first.progress.part_bytes);
  // The plan alone.
  EXPECT_EQ(again.progress.moved_bytes, again.progress.plan.ByteSizeLong() + 3);
  // A name that points to other bytes has other parts.
  ASSERT_TRUE(Create(RandomSet(2)).ok());
  EXPECT_NE(Stream({}).tile_set.btfels.codes, first.tile_set.btfels.codes);
}

TEST_F(TileSetStreamTest, DamagedCacheEntriesAreFetchedAgain) {
  const StreamedTileSet first = Stream({});
  const v1::TileSetPlan& plan = first.progress.plan;
  const auto path_of = [&](int part) {
    const std::string& digest = plan.parts(part).sha256();
    return folder_.path() / "cache" / "blobs" / digest.substr(0, 2) / digest;
  };
  std::string bytes = ReadWholeFile(path_of(1)).value();
  bytes[bytes.size() / 2] ^= 1;
  ASSERT_TRUE(WriteFileAtomically(path_of(1), bytes).ok());
  fs::resize_file(path_of(3), plan.parts(3).size_bytes() / 2);
  const StreamedTileSet again = Stream({});
  EXPECT_EQ(again.tile_set.btfels.codes, first.tile_set.btfels.codes);
  const uint64_t damaged = plan.parts(1).size_bytes() + plan.parts(3).size_bytes();
  EXPECT_GE(again.progress.moved_bytes, damaged);
  EXPECT_LE(again.progress.moved_bytes, damaged + 3 * plan.ByteSizeLong());
  EXPECT_LE(Stream({}).progress.moved_bytes, plan.ByteSizeLong() + 8);
}

TEST_F(TileSetStreamTest, TheCacheKeepsToItsLimit) {
  const uint64_t part_bytes = Stream({}).progress.part_bytes;
  fs::remove_all(folder_.path() / "cache");
  client_ = Connect(part_bytes / 2);
  const StreamedTileSet streamed = Stream({});
  uint64_t kept = 0;
  for (const fs::path& file : CachedFiles()) {
    kept += fs::file_size(file);
  }
  EXPECT_LE(kept, part_bytes / 2);
  EXPECT_GT(kept, 0u);
  EXPECT_EQ(streamed.progress.part_bytes, part_bytes);
  EXPECT_EQ(Stream({}).tile_set.btfels.codes, streamed.tile_set.btfels.codes);
}

TEST_F(TileSetStreamTest, NeedsThatCannotBeMetAreNamed) {
  const auto refused = [&](const SceneNeeds& needs, const char* subject, const char* what) {
    const absl::Status status = client_->StreamTileSet(kName, needs).status();
    EXPECT_EQ(SubjectOf(status), subject) << status;
    EXPECT_THAT(status.message(), HasSubstr(what));
    return ReasonOf(status);
  };
  refused({.tiles = {96}}, "tiles", "tile 96: the tile set has tiles 0 to 95");
  refused({.level = 4}, "level", "levels 0 to 3");
  EXPECT_TRUE(absl::IsInvalidArgument(client_->StreamTileSet(kName, {.level = -1}).status()));
  refused({.max_error = -1.0}, "max_error", "max_error -1");
  refused({.max_error = std::nan("")}, "max_error", "max_error nan");
  refused({.max_bytes = 0}, "max_bytes", "max_bytes 0");
  EXPECT_EQ(refused({.max_bytes = 100}, "max_bytes", "max_bytes is 100"), "BOUND_NOT_REACHED");
  const v1::TileSetPlan plan = Stream({}).progress.plan;
  const uint64_t two_parts = plan.parts(0).size_bytes() + plan.parts(1).size_bytes();
  refused({.max_error = 0.0, .max_bytes = two_parts}, "max_bytes", "reaches an error of");
  for (const std::optional<uint64_t> max_bytes :
       {std::optional<uint64_t>(), std::optional<uint64_t>(1 << 30)}) {
    EXPECT_EQ(refused({.level = 2, .max_error = 1e-7, .max_bytes = max_bytes}, "max_error",
                      "level 2 reaches an error of"),
              "BOUND_NOT_REACHED");
  }
  EXPECT_TRUE(absl::IsNotFound(client_->StreamTileSet("arrangements/surface-96/tileSets/none", {}).status()));
}

TEST_F(TileSetStreamTest, StopsWhenAsked) {
  std::stop_source stop;
  const auto stopped = client_->StreamTileSet(kName, {},
                                              [&](const TileSet&, const StreamProgress&) {
                                                stop.request_stop();
                                                return AfterPart::kGoOn;
                                              },
                                              {.stop = stop.get_token()});
  EXPECT_TRUE(absl::IsCancelled(stopped.status())) << stopped.status();
}

// A server of one tile set in three parts whose messages a test may change.
class LyingTileSets final : public v1::TileSets::Service {
 public:
  explicit LyingTileSets(const TileSet& tile_set) {
    TileSetCut cut;
    for (int i = 0; i < tile_set.btfels.num_coefficients; ++i) {
      cut.order.push_back(static_cast<uint32_t>(i));
      cut.fill.push_back(0.0F);
    }
    const auto k = static_cast<uint32_t>(cut.order.size());
    cut.ends = {1, 2, k};
    const TileSetCutter cutter = *TileSetCutter::Create(tile_set, cut);
    plan.set_num_tiles(96);
    plan.set_tile_size(static_cast<uint32_t>(tile_set.tile_size));
    plan.set_num_btfels(static_cast<uint32_t>(cutter.num_btfels()));
    plan.set_num_coefficients(k);
    for (size_t i = 0; i < 3; ++i) {
      parts.push_back(*cutter.Part(i, i == 0 ? "" : plan.parts(0).sha256()));
      v1::TileSetPart& part = *plan.add_parts();
      part.set_sha256(Sha256Hex(std::as_bytes(std::span(parts[i]))));
      part.set_size_bytes(parts[i].size());
      part.set_num_coefficients(cut.ends[i]);
      part.set_rmse(0.1 * (2.0 - static_cast<double>(i)));
    }
  }

  v1::TileSetPlan plan;
  std::vector<std::string> parts;
  int breaks = 0;                           // calls that end after one part
  std::vector<std::vector<uint32_t>> held;  // of each call that was not for the plan alone
  std::function<void(v1::TileSetChunk&)> change = [](v1::TileSetChunk&) {};

  grpc::Status StreamTileSet(grpc::ServerContext*, const v1::StreamTileSetRequest* request,
                             grpc::ServerWriter<v1::TileSetChunk>* writer) override {
    v1::TileSetChunk chunk;
    *chunk.mutable_plan() = plan;
    writer->Write(chunk);
    if (request->plan_only()) {
      return grpc::Status::OK;
    }
    held.emplace_back(request->held_parts().begin(), request->held_parts().end());
    for (uint32_t i = 0; i < 3; ++i) {
      if (std::ranges::find(request->held_parts(), i) == request->held_parts().end()) {
        v1::TileSetChunk bytes;
        bytes.set_part(i);
        bytes.set_data(parts[i]);
        change(bytes);
        writer->Write(bytes);
        if (breaks > 0) {
          --breaks;
          return {grpc::StatusCode::UNAVAILABLE, "going away"};
        }
      }
    }
    return grpc::Status::OK;
  }
};

class LyingServerTest : public ::testing::Test {
 protected:
  LyingServerTest() : tile_sets_(RandomSet()) {
    int port = 0;
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&tile_sets_);
    server_ = builder.BuildAndStart();
    client_ = *Client::Connect({.address = "127.0.0.1:" + std::to_string(port),
                                .retry = {.max_attempts = 3, .first_wait_ms = 1, .longest_wait_ms = 2},
                                .cache_folder = folder_.path() / "cache"});
  }
  ~LyingServerTest() override { server_->Shutdown(std::chrono::system_clock::now()); }

  void ExpectDataLoss(const char* what, const SceneNeeds& needs = {}) {
    const absl::Status status = client_->StreamTileSet(kName, needs).status();
    EXPECT_TRUE(absl::IsDataLoss(status)) << status;
    EXPECT_THAT(status.message(), HasSubstr(what));
  }

  TempFolder folder_;
  LyingTileSets tile_sets_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<Client> client_;
};

TEST_F(LyingServerTest, BytesOfAnotherDigestAreRefusedAndNotKept) {
  tile_sets_.change = [](v1::TileSetChunk& chunk) {
    if (chunk.part() == 1) {
      (*chunk.mutable_data())[40] ^= 1;
    }
  };
  ExpectDataLoss("part 1: the bytes received have SHA-256");
  tile_sets_.change = [](v1::TileSetChunk&) {};
  const auto streamed = client_->StreamTileSet(kName, {});
  ASSERT_TRUE(streamed.ok()) << streamed.status();
  EXPECT_TRUE(streamed->progress.is_all());
  EXPECT_EQ(tile_sets_.held.back().size(), 1u);  // part 0 was whole
}

TEST_F(LyingServerTest, WrongSizesAndUnaskedPartsAreRefused) {
  tile_sets_.change = [](v1::TileSetChunk& chunk) { chunk.mutable_data()->push_back('x'); };
  ExpectDataLoss("the plan says");
  tile_sets_.change = [](v1::TileSetChunk& chunk) { chunk.mutable_data()->pop_back(); };
  ExpectDataLoss("which were not asked for");
  tile_sets_.change = [](v1::TileSetChunk& chunk) { chunk.set_part(chunk.part() + 7); };
  ExpectDataLoss("which were not asked for");
  tile_sets_.change = [](v1::TileSetChunk& chunk) { chunk.mutable_plan(); };
  ExpectDataLoss("second plan");
  tile_sets_.change = [](v1::TileSetChunk& chunk) { chunk.clear_data(); };
  ExpectDataLoss("0 bytes");
}

TEST_F(LyingServerTest, PlansThatCannotBeAreRefused) {
  const v1::TileSetPlan honest = tile_sets_.plan;
  const auto refused = [&](const std::function<void(v1::TileSetPlan&)>& change, const char* what) {
    tile_sets_.plan = honest;
    change(tile_sets_.plan);
    ExpectDataLoss(what);
  };
  refused([](v1::TileSetPlan& plan) { plan.clear_parts(); }, "0 parts");
  refused([](v1::TileSetPlan& plan) { plan.mutable_parts(1)->set_rmse(9.0); }, "part 1");
  refused([](v1::TileSetPlan& plan) { plan.mutable_parts(1)->set_sha256("../../etc/passwd"); }, "part 1");
  refused([](v1::TileSetPlan& plan) { plan.mutable_parts(2)->set_num_coefficients(1); }, "part 2");
  refused([](v1::TileSetPlan& plan) { plan.set_num_btfels(7); }, "not what was asked for");
  tile_sets_.plan = honest;
  ExpectDataLoss("not what was asked for", {.tiles = {4}});
}

TEST_F(LyingServerTest, ALostConnectionIsTakenUpAfterTheLastWholePart) {
  tile_sets_.breaks = 2;
  const auto streamed = client_->StreamTileSet(kName, {});
  ASSERT_TRUE(streamed.ok()) << streamed.status();
  EXPECT_TRUE(streamed->progress.is_all());
  ASSERT_EQ(tile_sets_.held.size(), 3u);
  EXPECT_EQ(tile_sets_.held[2].size(), 2u);
}

}  // namespace
}  // namespace tessera
