// Download of a tile set from the server against a bare gRPC stream of the same bytes, and the time of a
// re-dress.
//
//   download_bench        CSV on stdout; exit 1 when a limit is missed
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include <grpcpp/grpcpp.h>

#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dress.h"
#include "btf/wang/redress.h"
#include "btf/wang/shapes.h"
#include "client/lib/client.h"
#include "server/server.h"
#include "tessera/v1/tessera.grpc.pb.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kLeastShareOfBareStream = 0.5;
constexpr double kMostRedressMs = 10.0;
constexpr int kRounds = 31;
constexpr size_t kChunkBytes = 1 << 20;

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

double Median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

// What surface-96 of a 128 x 128 material at 25 x 25 coefficients amounts to, in random codes.
absl::StatusOr<TileSet> LargeTileSet() {
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement("surface-96"));
  constexpr int kTileSize = 64;
  constexpr int kNumBtfels = 14000;
  constexpr int kNumCoefficients = 3 * 25 * 25;
  TileSet tile_set;
  tile_set.arrangement_id = arrangement->id;
  tile_set.arrangement_sha256 = arrangement->sha256;
  tile_set.tile_size = kTileSize;
  tile_set.strip_height = 16;
  tile_set.tile_codes = arrangement->codes;
  Rng rng(1);
  for (size_t i = 0; i < arrangement->codes.size() * kTileSize * kTileSize; ++i) {
    tile_set.tile_index.push_back(
        PackTexel(static_cast<uint32_t>(rng.NextBelow(kNumBtfels)), static_cast<int>(rng.NextBelow(4))));
  }
  BtfelTable& table = tile_set.btfels;
  table.codec_id = "dsh-cls";
  table.codec_version = 1;
  table.num_coefficients = kNumCoefficients;
  table.offset.assign(kNumCoefficients, 0.0F);
  table.step.assign(kNumCoefficients, 0.01F);
  CodecTable identity{{25, 25}, std::vector<float>(25 * 25, 0.0F)};
  for (size_t i = 0; i < 25; ++i) {
    identity.values[i * 26] = 1.0F;
  }
  table.tables["basis_light"] = identity;
  table.tables["basis_view"] = identity;
  table.parameters = {{"kl", 25}, {"kv", 25}};
  table.views = {{0.0, 0.0}, {1.2, 0.0}};
  table.lights = table.views;
  table.codes.resize(size_t{kNumBtfels} * kNumCoefficients);
  for (uint8_t& code : table.codes) {
    code = static_cast<uint8_t>(rng.Next());
  }
  return tile_set;
}

// The peer: the same bytes in the same chunks, read from memory, with nothing around them.
class BareStream final : public v1::Blobs::Service {
 public:
  explicit BareStream(const std::string& bytes) {
    for (size_t offset = 0; offset < bytes.size(); offset += kChunkBytes) {
      chunks_.emplace_back().set_data(bytes.substr(offset, kChunkBytes));
    }
  }
  grpc::Status ReadBlob(grpc::ServerContext*, const v1::ReadBlobRequest*,
                        grpc::ServerWriter<v1::DataChunk>* writer) override {
    for (const v1::DataChunk& chunk : chunks_) {
      writer->Write(chunk);
    }
    return grpc::Status::OK;
  }

 private:
  std::vector<v1::DataChunk> chunks_;
};

absl::StatusOr<size_t> ReadBare(v1::Blobs::Stub& stub) {
  grpc::ClientContext context;
  const auto stream = stub.ReadBlob(&context, v1::ReadBlobRequest());
  v1::DataChunk chunk;
  size_t size = 0;
  while (stream->Read(&chunk)) {
    size += chunk.data().size();
  }
  if (!stream->Finish().ok()) {
    return absl::InternalError("the bare stream broke");
  }
  return size;
}

// Prints the figures; true when they are within the limits.
absl::StatusOr<bool> Run() {
  const TempFolder folder;
  TESSERA_ASSIGN_OR_RETURN(
      const auto server,
      Server::Start({.data_folder = folder.path() / "data", .listen = "127.0.0.1:0", .num_workers = 1}));
  TESSERA_ASSIGN_OR_RETURN(const auto client, Client::Connect({.address = std::string(server->address()),
                                                               .cache_folder = folder.path() / "cache"}));
  TESSERA_ASSIGN_OR_RETURN(const TileSet tile_set, LargeTileSet());
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, SerializeTileSet(tile_set));
  TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client->UploadBytes(std::as_bytes(std::span(bytes))));
  v1::CreateTileSetRequest create;
  create.set_name("arrangements/surface-96/tileSets/large");
  create.set_blob_sha256(blob.sha256());
  TESSERA_RETURN_IF_ERROR(client->CreateTileSet(create).status());

  BareStream bare(bytes);
  int port = 0;
  grpc::ServerBuilder builder;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.RegisterService(&bare);
  const std::unique_ptr<grpc::Server> bare_server = builder.BuildAndStart();
  const auto stub = v1::Blobs::NewStub(
      grpc::CreateChannel("127.0.0.1:" + std::to_string(port), grpc::InsecureChannelCredentials()));

  std::vector<double> bare_s;
  std::vector<double> download_s;
  std::vector<double> shares;  // of one round: both met the same neighbours on the machine
  for (int round = 0; round <= kRounds; ++round) {
    auto begin = Clock::now();
    TESSERA_RETURN_IF_ERROR(ReadBare(*stub).status());
    const double bare_seconds = SecondsSince(begin);
    begin = Clock::now();
    TESSERA_ASSIGN_OR_RETURN(const std::string downloaded, client->ReadBlob(blob));
    const double download_seconds = SecondsSince(begin);
    if (downloaded != bytes) {
      return absl::DataLossError("the download differs from what was uploaded");
    }
    if (round > 0) {  // the first one warms up
      bare_s.push_back(bare_seconds);
      download_s.push_back(download_seconds);
      shares.push_back(bare_seconds / download_seconds);
    }
  }
  bare_server->Shutdown();
  const double megabytes = static_cast<double>(bytes.size()) / 1e6;
  const double share = Median(shares);

  TESSERA_ASSIGN_OR_RETURN(const QuadMesh torus, BuiltinShape("torus"));
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement("surface-96"));
  TESSERA_ASSIGN_OR_RETURN(const DressResult dressed, DressMesh(torus, *arrangement, {}, {}));
  std::vector<double> redress_ms;
  for (int round = 0; round < kRounds; ++round) {
    const auto begin = Clock::now();
    TESSERA_ASSIGN_OR_RETURN(const Binding binding, Redress(dressed.dressing, tile_set));
    redress_ms.push_back(1e3 * SecondsSince(begin));
  }

  const auto verdict = [](bool reached) { return reached ? "ok" : "MISSED"; };
  std::printf("name,value,unit,limit,verdict\n");
  std::printf("size,%.1f,MB,,\n", megabytes);
  std::printf("bare_stream,%.0f,MB/s,,\n", megabytes / Median(bare_s));
  std::printf("download,%.0f,MB/s,,\n", megabytes / Median(download_s));
  std::printf("download_share_of_bare_stream,%.2f,,>=%.2f,%s\n", share, kLeastShareOfBareStream,
              verdict(share >= kLeastShareOfBareStream));
  std::printf("redress,%.3f,ms,<%.0f,%s\n", Median(redress_ms), kMostRedressMs,
              verdict(Median(redress_ms) < kMostRedressMs));
  return share >= kLeastShareOfBareStream && Median(redress_ms) < kMostRedressMs;
}

}  // namespace
}  // namespace tessera

int main() {
  const absl::StatusOr<bool> within_limits = tessera::Run();
  if (!within_limits.ok()) {
    std::fprintf(stderr, "download_bench: %s\n", within_limits.status().ToString().c_str());
    return EXIT_FAILURE;
  }
  return *within_limits ? EXIT_SUCCESS : EXIT_FAILURE;
}
