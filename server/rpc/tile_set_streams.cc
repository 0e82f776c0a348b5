#include "server/rpc/tile_set_streams.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <set>
#include <span>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "btf/base/reason.h"
#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/refine/level_set.h"
#include "btf/refine/refinement.h"
#include "server/jobs/job.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kPlanPoll{20};

// The longest used first; null when there is none of this key.
template <typename Kept>
std::shared_ptr<Kept> Use(std::list<std::shared_ptr<Kept>>& kept, const std::string& key) {
  const auto found =
      std::ranges::find_if(kept, [&key](const std::shared_ptr<Kept>& each) { return each->key == key; });
  if (found == kept.end()) {
    return nullptr;
  }
  kept.splice(kept.begin(), kept, found);
  return kept.front();
}

uint64_t SizeOf(const TileSet& tile_set) {
  uint64_t bytes = tile_set.btfels.codes.size() +
                   sizeof(uint32_t) * (tile_set.tile_index.size() + tile_set.source_pixels.size());
  for (const auto& [name, table] : tile_set.btfels.tables) {
    bytes += table.values.size() * sizeof(float);
  }
  return bytes;
}

uint64_t SizeOf(const TileSetCut& cut) {
  uint64_t bytes = 0;
  if (cut.layers != nullptr) {
    for (const TileSetLayer& layer : cut.layers->layers) {
      bytes += sizeof(int32_t) * (layer.codes.size() + layer.basis.size() + layer.cores.size());
    }
  }
  return bytes;
}

absl::Status BeyondBytes(const std::string& message) {
  return WithReason(absl::FailedPreconditionError(message), "BOUND_NOT_REACHED", "max_bytes");
}

}  // namespace

absl::StatusOr<SceneNeeds> SceneNeedsFromMessage(const v1::TileSetNeeds& message) {
  SceneNeeds needs;
  needs.tiles.assign(message.tiles().begin(), message.tiles().end());
  std::ranges::sort(needs.tiles);
  needs.tiles.erase(std::ranges::unique(needs.tiles).begin(), needs.tiles.end());
  needs.level = static_cast<int>(std::min<uint32_t>(message.level(), std::numeric_limits<int>::max()));
  if (message.has_max_error()) {
    needs.max_error = message.max_error();
  }
  if (message.has_max_bytes()) {
    needs.max_bytes = message.max_bytes();
  }
  const auto light = message.light().empty() ? SceneLight::kPoint : FindSceneLight(message.light());
  if (!light.has_value()) {
    return WithReason(absl::InvalidArgumentError(
                          absl::StrCat("light \"", message.light(), "\", expected point or environment")),
                      "ARGUMENT_INVALID", "light");
  }
  needs.light = *light;
  return needs;
}

absl::StatusOr<std::shared_ptr<const TileSet>> TileSetStreams::ReadTileSet(const std::string& sha256) {
  for (const std::shared_ptr<const Source>& source : sources_) {
    if (source->key.starts_with(absl::StrCat(sha256, " 0 "))) {
      return source->tile_set;
    }
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, blobs_.ReadAll(sha256, kMaxContainerBytes));
  TESSERA_ASSIGN_OR_RETURN(TileSet tile_set, ParseTileSet(std::as_bytes(std::span(bytes))));
  return std::make_shared<const TileSet>(std::move(tile_set));
}

absl::StatusOr<std::shared_ptr<const TileSetStreams::Source>> TileSetStreams::FindSource(
    const std::string& sha256, const SceneNeeds& needs, const RunContext& context) {
  const std::string level_key = absl::StrCat(sha256, " ", needs.level, " ");
  const std::string key = level_key + std::string(SceneLightName(needs.light));
  if (std::shared_ptr<const Source> kept = Use(sources_, key)) {
    return kept;
  }
  auto source = std::make_shared<Source>();
  source->key = key;
  for (const std::shared_ptr<const Source>& other : sources_) {
    if (other->key.starts_with(level_key)) {  // under another light
      source->tile_set = other->tile_set;
      source->level_rmse = other->level_rmse;
    }
  }
  if (source->tile_set == nullptr) {
    TESSERA_ASSIGN_OR_RETURN(source->tile_set, ReadTileSet(sha256));
    if (needs.level > 0) {
      TESSERA_ASSIGN_OR_RETURN(LevelSet level, MakeLevelSet(*source->tile_set, needs.level, context));
      source->tile_set = std::make_shared<const TileSet>(std::move(level.tile_set));
      source->level_rmse = level.rmse;
    }
  }
  const TileSet& tile_set = *source->tile_set;
  TESSERA_ASSIGN_OR_RETURN(source->refinement,
                           MakeRefinement(tile_set, {.level = needs.level, .light = needs.light}, context));
  sources_.push_front(source);
  return source;
}

absl::StatusOr<std::shared_ptr<TileSetStreams::Cut>> TileSetStreams::FindCut(const std::string& sha256,
                                                                             const SceneNeeds& needs,
                                                                             const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<const Source> source, FindSource(sha256, needs, context));
  const std::string key = absl::StrCat(source->key, " ", absl::StrJoin(needs.tiles, ","));
  if (std::shared_ptr<Cut> kept = Use(cuts_, key)) {
    return kept;
  }
  auto cut = std::make_shared<Cut>();
  cut->key = key;
  cut->source = source;
  TileSetCut of_tiles = source->refinement.cut;
  of_tiles.tiles = needs.tiles;
  of_tiles.origin = {
      {"tile_set_sha256", sha256}, {"level", needs.level}, {"light", SceneLightName(needs.light)}};
  TESSERA_ASSIGN_OR_RETURN(TileSetCutter cutter,
                           TileSetCutter::Create(*source->tile_set, std::move(of_tiles)));
  cut->cutter = std::make_unique<TileSetCutter>(std::move(cutter));
  cuts_.push_front(cut);
  return cut;
}

absl::Status TileSetStreams::MakePart(size_t index, Cut& cut) {
  if (index < cut.parts.size()) {
    return absl::OkStatus();
  }
  TESSERA_ASSIGN_OR_RETURN(std::string bytes,
                           cut.cutter->Part(index, index == 0 ? std::string() : cut.digests[0]));
  cut.digests.push_back(Sha256Hex(std::as_bytes(std::span(bytes))));
  cut.parts.push_back(std::make_shared<const std::string>(std::move(bytes)));
  return absl::OkStatus();
}

void TileSetStreams::DropUnused() {
  std::set<const TileSet*> counted;  // sources of two lights share one
  uint64_t total = 0;
  const auto keeps = [&](uint64_t bytes) {
    total += bytes;
    return total <= limit_bytes_;
  };
  // Parts go before what they are cut from.
  std::erase_if(sources_, [&](const std::shared_ptr<const Source>& source) {
    return source != sources_.front() &&
           !keeps(SizeOf(source->refinement.cut) +
                  (counted.insert(source->tile_set.get()).second ? SizeOf(*source->tile_set) : 0));
  });
  std::erase_if(cuts_, [&](const std::shared_ptr<Cut>& cut) {
    uint64_t bytes = 0;
    for (const std::shared_ptr<const std::string>& part : cut->parts) {
      bytes += part->size();
    }
    const bool is_orphan = std::ranges::find(sources_, cut->source) == sources_.end();
    return is_orphan || !keeps(bytes);
  });
}

absl::StatusOr<PlannedStream> TileSetStreams::Plan(const v1::TileSet& tile_set, const SceneNeeds& asked,
                                                   const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckNeeds(asked, tile_set.num_tiles(), static_cast<int>(tile_set.tile_size())));
  SceneNeeds needs = asked;
  if (needs.tiles.size() == tile_set.num_tiles()) {
    needs.tiles.clear();
  }
  std::unique_lock lock(mutex_, std::defer_lock);
  while (!lock.try_lock_for(kPlanPoll)) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  TESSERA_ASSIGN_OR_RETURN(const std::shared_ptr<Cut> cut, FindCut(tile_set.blob().sha256(), needs, context));
  const Source& source = *cut->source;
  PlannedStream planned;
  v1::TileSetPlan& plan = planned.plan;
  plan.set_tile_set_sha256(tile_set.blob().sha256());
  plan.set_tile_set_bytes(tile_set.blob().size_bytes());
  plan.set_num_tiles(needs.tiles.empty() ? tile_set.num_tiles() : static_cast<uint32_t>(needs.tiles.size()));
  plan.set_tile_size(static_cast<uint32_t>(source.tile_set->tile_size));
  plan.set_num_btfels(static_cast<uint32_t>(cut->cutter->num_btfels()));
  plan.set_num_coefficients(static_cast<uint32_t>(source.tile_set->btfels.num_coefficients));
  plan.set_level_rmse(source.level_rmse);
  plan.set_directions(source.refinement.directions);
  uint64_t bytes = 0;
  for (size_t part = 0; part < cut->cutter->num_parts(); ++part) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    TESSERA_RETURN_IF_ERROR(MakePart(part, *cut));
    const double reached = part == 0 ? 0.0 : source.refinement.rmse[part - 1];
    bytes += cut->parts[part]->size();
    if (needs.max_bytes.has_value() && bytes > *needs.max_bytes) {
      if (part == 0) {
        return BeyondBytes(absl::StrCat("the first part of ", plan.num_tiles(), " tiles at level ",
                                        needs.level, " has ", bytes, " bytes, max_bytes is ",
                                        *needs.max_bytes));
      }
      if (needs.max_error.has_value()) {
        return BeyondBytes(absl::StrCat("max_bytes ", *needs.max_bytes, " reaches an error of ", reached,
                                        ", max_error is ", *needs.max_error));
      }
      break;
    }
    v1::TileSetPart& message = *plan.add_parts();
    message.set_sha256(cut->digests[part]);
    message.set_size_bytes(cut->parts[part]->size());
    message.set_num_coefficients(static_cast<uint32_t>(cut->cutter->num_coefficients(part)));
    message.set_rmse(source.refinement.rmse[part]);
    planned.parts.push_back(cut->parts[part]);
    if (needs.max_error.has_value() && source.refinement.rmse[part] <= *needs.max_error) {
      break;
    }
  }
  DropUnused();
  const double reached = plan.parts(plan.parts_size() - 1).rmse();
  if (needs.max_error.value_or(0.0) > 0.0 && reached > *needs.max_error) {
    return WithReason(
        absl::FailedPreconditionError(absl::StrCat("level ", needs.level, " reaches an error of ", reached,
                                                   ", max_error is ", *needs.max_error)),
        "BOUND_NOT_REACHED", "max_error");
  }
  return planned;
}

}  // namespace tessera
