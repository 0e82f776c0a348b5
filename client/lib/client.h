// The Tessera client: one connection to a server, every service of tessera.proto, with retries, resumable
// transfers checked by digest, and a local cache of tile sets.
//
//   TESSERA_ASSIGN_OR_RETURN(auto client, Client::Connect({.address = "127.0.0.1:7723"}));
//   TESSERA_ASSIGN_OR_RETURN(TileSet tile_set,
//   client->FetchTileSet("arrangements/surface-96/tileSets/wool")); TESSERA_ASSIGN_OR_RETURN(Binding binding,
//   Redress(dressing, tile_set));
//
// Errors. A call returns what the server said, as an absl::Status with the server's ErrorDetail as payload
// (proto/wire/status.h reads its stable reason). The client adds: UNAVAILABLE once retries are used up,
// CANCELLED after a stop request, DATA_LOSS when bytes do not have the digest they were asked by, and the
// status of the local file system. Mutations get a random request_id unless the caller sets one, so that a
// repeated call does nothing twice.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/wang/dressing.h"
#include "btf/wang/scene_needs.h"
#include "btf/wang/tile_set.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

// Where server and client meet unless told otherwise.
inline constexpr std::string_view kDefaultServerAddress = "127.0.0.1:7723";

// Calls that end with UNAVAILABLE are repeated after a wait that doubles from `first_wait_ms` up to
// `longest_wait_ms`, shortened by up to half at random. A transfer or a watch that got further counts from
// the first attempt again.
struct RetryPolicy {
  int max_attempts = 8;
  int first_wait_ms = 100;
  int longest_wait_ms = 2000;
};

struct ClientOptions {
  std::string address{kDefaultServerAddress};  // HOST:PORT
  // How long Connect may take; a refused connection fails at once.
  int connect_timeout_ms = 5000;
  RetryPolicy retry;
  // Empty: DefaultCacheFolder().
  std::filesystem::path cache_folder;
  // What the cache may take before the longest unused goes; 0: 4 GiB.
  uint64_t cache_limit_bytes = 0;
};

// How far a streamed tile set has come.
struct StreamProgress {
  v1::TileSetPlan plan;      // all parts that the needs are worth, with their errors
  size_t num_parts = 0;      // of the plan, that are here
  uint64_t part_bytes = 0;   // of these
  uint64_t moved_bytes = 0;  // that came from the server: plans, and parts that were not in the cache

  // RMSE against the whole, as TileSetPart.rmse; once a part is here.
  [[nodiscard]] double rmse() const { return plan.parts(static_cast<int>(num_parts) - 1).rmse(); }
  [[nodiscard]] bool is_all() const { return std::cmp_equal(num_parts, plan.parts_size()); }
};
struct StreamedTileSet {
  TileSet tile_set;  // can be drawn; wang/tile_set_parts.h says what it lacks
  StreamProgress progress;
};
enum class AfterPart { kGoOn, kStop };
// Called after each part, the first included, on the calling thread.
using OnPart = std::function<AfterPart(const TileSet& tile_set, const StreamProgress& progress)>;

// $XDG_CACHE_HOME/tessera, else ~/.cache/tessera, else a folder of the user's in the temporary folder.
[[nodiscard]] std::filesystem::path DefaultCacheFolder();

// What a watcher does with the job when its own work is stopped.
enum class OnStop { kLeaveJob, kCancelJob };

// Thread-safe; calls may run at the same time.
class Client {
 public:
  // A client whose connection stands. Errors: INVALID_ARGUMENT (address), UNAVAILABLE naming the address,
  // CANCELLED.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<Client>> Connect(ClientOptions options,
                                                                       const RunContext& context = {});
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  [[nodiscard]] const ClientOptions& options() const { return options_; }

  // Server.
  [[nodiscard]] absl::StatusOr<v1::ServerStatus> GetServerStatus(const RunContext& context = {});

  // Materials. Names are full: "materials/wool" (names.h makes them). Lists are gathered over all pages.
  [[nodiscard]] absl::StatusOr<v1::Material> CreateMaterial(v1::CreateMaterialRequest request,
                                                            const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::Job> ImportMaterial(v1::ImportMaterialRequest request,
                                                       const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::Job> GenerateMaterial(v1::GenerateMaterialRequest request,
                                                         const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::Material> GetMaterial(std::string_view name,
                                                         const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<std::vector<v1::Material>> ListMaterials(const RunContext& context = {});
  [[nodiscard]] absl::Status DeleteMaterial(std::string_view name, const RunContext& context = {});

  // Arrangements.
  [[nodiscard]] absl::StatusOr<v1::Arrangement> GetArrangement(std::string_view name,
                                                               const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<std::vector<v1::Arrangement>> ListArrangements(const RunContext& context = {});

  // Tile sets.
  [[nodiscard]] absl::StatusOr<v1::Job> SynthesizeTileSet(v1::SynthesizeTileSetRequest request,
                                                          const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::Job> CertifyTileSet(v1::CertifyTileSetRequest request,
                                                       const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::TileSet> CreateTileSet(v1::CreateTileSetRequest request,
                                                          const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::TileSet> GetTileSet(std::string_view name, const RunContext& context = {});
  // `parent` is "arrangements/A", or empty for all.
  [[nodiscard]] absl::StatusOr<std::vector<v1::TileSet>> ListTileSets(std::string_view parent,
                                                                      const RunContext& context = {});
  [[nodiscard]] absl::Status DeleteTileSet(std::string_view name, const RunContext& context = {});

  // Jobs.
  [[nodiscard]] absl::StatusOr<v1::Job> GetJob(std::string_view name, const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<std::vector<v1::Job>> ListJobs(const RunContext& context = {});
  // Ends the job for everyone who asked for it.
  [[nodiscard]] absl::StatusOr<v1::Job> CancelJob(std::string_view name, const RunContext& context = {});
  // Calls `on_event` for every event after `after_sequence`, each once and in order, and returns the job in
  // its final state, whatever that is. A lost connection is taken up again after the last event seen.
  [[nodiscard]] absl::StatusOr<v1::Job> WatchJob(std::string_view name, uint64_t after_sequence,
                                                 const std::function<void(const v1::JobEvent&)>& on_event,
                                                 const RunContext& context = {});
  // Watches until the job ends, its progress reported through context.progress. Returns the job if it
  // SUCCEEDED, else JobFailure(job). After a stop request returns CANCELLED and, with kCancelJob, has
  // cancelled the job; one that this client asked for goes on while another client waits for the same work.
  [[nodiscard]] absl::StatusOr<v1::Job> WaitForJob(std::string_view name, OnStop on_stop,
                                                   const RunContext& context = {});

  // Dressings and pictures, made by the server.
  [[nodiscard]] absl::StatusOr<v1::DressMeshResponse> DressMesh(v1::DressMeshRequest request,
                                                                const RunContext& context = {});
  // The bytes of a PNG or EXR file. Progress is the server's.
  [[nodiscard]] absl::StatusOr<std::string> RenderPreview(v1::RenderPreviewRequest request,
                                                          const RunContext& context = {});

  // Blobs. Progress counts bytes. An upload continues where an earlier one of the same bytes stopped, also
  // one of another process; a blob that the server holds is not sent again.
  [[nodiscard]] absl::StatusOr<v1::Blob> UploadBytes(std::span<const std::byte> bytes,
                                                     const RunContext& context = {});
  // Takes no memory beyond what `file` refers to.
  [[nodiscard]] absl::StatusOr<v1::Blob> UploadContainer(const ContainerFile& file,
                                                         const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<v1::Blob> UploadFile(const std::filesystem::path& path,
                                                    const RunContext& context = {});
  // The whole blob in memory, digest checked.
  [[nodiscard]] absl::StatusOr<std::string> ReadBlob(const v1::Blob& blob, const RunContext& context = {});
  // The same written to `path`, which is either complete or untouched: a file beside it is renamed at the
  // end.
  [[nodiscard]] absl::Status DownloadFile(const v1::Blob& blob, const std::filesystem::path& path,
                                          const RunContext& context = {});

  // Whole resources. Containers that are in the local cache are not downloaded again (a name is always looked
  // up on the server: it may point to new bytes).
  [[nodiscard]] absl::StatusOr<Material> FetchMaterial(std::string_view name, const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<TileSet> FetchTileSet(std::string_view name, const RunContext& context = {});
  // Only what a scene needs of a tile set, the most visible first: NeedsOfDressing (wang/scene_needs.h) tells
  // the tiles of a dressing. Ends after the plan's last part, or when `on_part` says so. Parts are kept in
  // the cache by their digest, also when the stream is stopped; a lost connection is taken up again after the
  // last whole part. Errors: the server's; DATA_LOSS when a part is not what the plan says, or not what was
  // asked for.
  [[nodiscard]] absl::StatusOr<StreamedTileSet> StreamTileSet(std::string_view name, const SceneNeeds& needs,
                                                              const OnPart& on_part = {},
                                                              const RunContext& context = {});
  [[nodiscard]] absl::StatusOr<Dressing> FetchDressing(const v1::Blob& blob, const RunContext& context = {});
  // The bytes of a blob, from the cache or downloaded into it. A cache that cannot be written is not an
  // error.
  [[nodiscard]] absl::StatusOr<std::string> FetchBlob(const v1::Blob& blob, const RunContext& context = {});

 private:
  struct Stubs;
  Client(ClientOptions options, std::unique_ptr<Stubs> stubs);
  // Notes that the call of this request_id was answered with `job`.
  absl::StatusOr<v1::Job> Asked(absl::StatusOr<v1::Job> job, const std::string& request_id);
  // One noted request_id of the job, taken from the notes; empty when there is none.
  std::string TakeRequestId(std::string_view job_name);

  ClientOptions options_;
  std::unique_ptr<Stubs> stubs_;
  std::mutex asked_mutex_;
  std::multimap<std::string, std::string, std::less<>> asked_;  // job -> request_id; guarded by asked_mutex_
};

// The error of a job that ended FAILED or CANCELLED, its ErrorDetail as payload; OK for any other state.
[[nodiscard]] absl::Status JobFailure(const v1::Job& job);
// The job that a status of JobFailure is about, "jobs/J"; empty for other statuses. Tells a job that failed
// from a call that did.
[[nodiscard]] std::string FailedJob(const absl::Status& status);

}  // namespace tessera
