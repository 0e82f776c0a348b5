// The parts of tile sets that scenes ask for (TileSets.StreamTileSet): planned once, and kept in memory.
//
//   TESSERA_ASSIGN_OR_RETURN(PlannedStream planned, streams.Plan(tile_set, needs, context));
//
// Kept by the digest of the tile set, at most kKeptStreamBytes of both kinds together, the longest unused
// dropped first: the tile set, or a level of it, with the order or the layers of its coefficients and the
// errors of its prefixes, for each kind of light; and the parts that a set of tiles was cut into, made when a
// plan first reaches them.
#pragma once

#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/refine/refinement.h"
#include "btf/wang/scene_needs.h"
#include "btf/wang/tile_set.h"
#include "btf/wang/tile_set_parts.h"
#include "server/catalog/blob_store.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera {

inline constexpr uint64_t kKeptStreamBytes = uint64_t{256} << 20;

// Errors: INVALID_ARGUMENT with the field as subject.
[[nodiscard]] absl::StatusOr<SceneNeeds> SceneNeedsFromMessage(const v1::TileSetNeeds& message);

struct PlannedStream {
  v1::TileSetPlan plan;
  std::vector<std::shared_ptr<const std::string>> parts;  // those of the plan
};

// Thread-safe: plans are made one after the other.
class TileSetStreams {
 public:
  explicit TileSetStreams(BlobStore& blobs, uint64_t limit_bytes = kKeptStreamBytes)
      : blobs_(blobs), limit_bytes_(limit_bytes) {}

  // Errors: INVALID_ARGUMENT naming the field and its limit; FAILED_PRECONDITION, reason BOUND_NOT_REACHED,
  // naming what would be needed where max_bytes does not reach, and what a level reaches where max_error lies
  // below; those of MakeLevelSet; CANCELLED.
  [[nodiscard]] absl::StatusOr<PlannedStream> Plan(const v1::TileSet& tile_set, const SceneNeeds& needs,
                                                   const RunContext& context);

 private:
  // A tile set, or a level of it, under one kind of light.
  struct Source {
    std::string key;
    std::shared_ptr<const TileSet> tile_set;
    double level_rmse = 0.0;
    Refinement refinement;
  };
  // A source cut for some tiles; parts are made as they are asked for.
  struct Cut {
    std::string key;
    std::shared_ptr<const Source> source;
    std::unique_ptr<TileSetCutter> cutter;
    std::vector<std::shared_ptr<const std::string>> parts;
    std::vector<std::string> digests;  // of the parts
  };

  [[nodiscard]] absl::StatusOr<std::shared_ptr<const TileSet>> ReadTileSet(const std::string& sha256);
  [[nodiscard]] absl::StatusOr<std::shared_ptr<const Source>> FindSource(const std::string& sha256,
                                                                         const SceneNeeds& needs,
                                                                         const RunContext& context);
  [[nodiscard]] absl::StatusOr<std::shared_ptr<Cut>> FindCut(const std::string& sha256,
                                                             const SceneNeeds& needs,
                                                             const RunContext& context);
  // Makes part `index`; those before are there.
  [[nodiscard]] static absl::Status MakePart(size_t index, Cut& cut);
  void DropUnused();

  BlobStore& blobs_;
  const uint64_t limit_bytes_;
  std::timed_mutex mutex_;  // guards the lists, in order of use, the last first, and what they hold
  std::list<std::shared_ptr<const Source>> sources_;
  std::list<std::shared_ptr<Cut>> cuts_;
};

}  // namespace tessera
