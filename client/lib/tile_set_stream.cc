// Client::StreamTileSet: parts from the cache and from the server, put together as they come.
#include <algorithm>
#include <optional>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "btf/wang/tile_set_parts.h"
#include "client/lib/blob_cache.h"
#include "client/lib/client.h"
#include "client/lib/stubs.h"

namespace tessera {
namespace {

constexpr int kMostPlanParts = 1024;
// A tile set that is replaced while it is streamed begins again, but not for ever.
constexpr int kMostPlans = 4;

v1::TileSetNeeds MessageOfNeeds(const SceneNeeds& needs) {
  v1::TileSetNeeds message;
  message.mutable_tiles()->Add(needs.tiles.begin(), needs.tiles.end());
  message.set_level(static_cast<uint32_t>(std::max(needs.level, 0)));
  if (needs.max_error.has_value()) {
    message.set_max_error(*needs.max_error);
  }
  if (needs.max_bytes.has_value()) {
    message.set_max_bytes(*needs.max_bytes);
  }
  message.set_light(std::string(SceneLightName(needs.light)));
  return message;
}

absl::Status CheckPlan(const v1::TileSetPlan& plan) {
  if (plan.parts_size() < 1 || plan.parts_size() > kMostPlanParts) {
    return absl::DataLossError(
        absl::StrCat("the server's plan has ", plan.parts_size(), " parts, expected 1 to ", kMostPlanParts));
  }
  for (int i = 0; i < plan.parts_size(); ++i) {
    const v1::TileSetPart& part = plan.parts(i);
    const uint32_t before = i == 0 ? 0 : plan.parts(i - 1).num_coefficients();
    const bool falls = i == 0 || part.rmse() <= plan.parts(i - 1).rmse();
    if (part.sha256().size() != 64 || part.size_bytes() == 0 || part.num_coefficients() < before ||
        part.num_coefficients() > plan.num_coefficients() || !(part.rmse() >= 0.0) || !falls) {
      return absl::DataLossError(absl::StrCat("the server's plan: part ", i, " of ", part.size_bytes(),
                                              " bytes with ", part.num_coefficients(), " of ",
                                              plan.num_coefficients(), " coefficients and error ",
                                              part.rmse(), " does not follow the one before"));
    }
  }
  return absl::OkStatus();
}

bool IsSamePlan(const v1::TileSetPlan& a, const v1::TileSetPlan& b) {
  return a.SerializeAsString() == b.SerializeAsString();
}

// The parts that came, and what they make.
class Assembly {
 public:
  Assembly(const SceneNeeds& needs, const OnPart& on_part, const BlobCache& cache)
      : needs_(needs), on_part_(on_part), cache_(cache) {}

  [[nodiscard]] const v1::TileSetPlan& plan() const { return progress_.plan; }
  [[nodiscard]] bool has_plan() const { return progress_.plan.parts_size() > 0; }
  [[nodiscard]] bool is_done() const { return stopped_ || (has_plan() && progress_.is_all()); }
  [[nodiscard]] bool HasPart(size_t part) const {
    return part < progress_.num_parts || waiting_[part].has_value();
  }

  [[nodiscard]] size_t num_parts() const { return progress_.num_parts; }
  [[nodiscard]] uint64_t BytesToCome() const {
    uint64_t bytes = 0;
    for (int part = 0; part < plan().parts_size(); ++part) {
      bytes += HasPart(static_cast<size_t>(part)) ? 0 : plan().parts(part).size_bytes();
    }
    return bytes;
  }

  void Count(uint64_t bytes) { progress_.moved_bytes += bytes; }

  // Begins again, with what the cache has of this plan.
  absl::Status Take(const v1::TileSetPlan& plan) {
    TESSERA_RETURN_IF_ERROR(CheckPlan(plan));
    assembler_.reset();
    progress_ = {.plan = plan, .moved_bytes = progress_.moved_bytes};
    waiting_.assign(static_cast<size_t>(plan.parts_size()), std::nullopt);
    for (size_t i = 0; i < waiting_.size(); ++i) {
      waiting_[i] = cache_.Read(plan.parts(static_cast<int>(i)).sha256());
    }
    return Advance();
  }

  // More bytes of a part.
  absl::Status Receive(const v1::TileSetChunk& chunk) {
    const size_t part = chunk.part();
    if (part >= waiting_.size() || HasPart(part) || (!coming_.empty() && part != coming_part_)) {
      return absl::DataLossError(
          absl::StrCat("the server sent bytes of part ", part, ", which were not asked for"));
    }
    coming_part_ = part;
    coming_.append(chunk.data());
    const v1::TileSetPart& planned = plan().parts(static_cast<int>(part));
    if (coming_.size() > planned.size_bytes() || chunk.data().empty()) {
      return absl::DataLossError(
          absl::StrCat("part ", part, ": ", coming_.size(), " bytes, the plan says ", planned.size_bytes()));
    }
    if (coming_.size() < planned.size_bytes()) {
      return absl::OkStatus();
    }
    const std::string digest = Sha256Hex(std::as_bytes(std::span(coming_)));
    if (digest != planned.sha256()) {
      return absl::DataLossError(absl::StrCat("part ", part, ": the bytes received have SHA-256 ", digest,
                                              ", the plan says ", planned.sha256()));
    }
    (void)cache_.Put(digest, coming_);  // a cache that takes it not costs only the next download
    waiting_[part] = std::exchange(coming_, {});
    return Advance();
  }

  // A broken connection leaves no half part.
  void DropHalfPart() { coming_.clear(); }

  absl::StatusOr<StreamedTileSet> Finish() && {
    if (!assembler_.has_value()) {
      return absl::DataLossError("the server ended the stream before its first part");
    }
    return StreamedTileSet{(*std::move(assembler_)).Take(), std::move(progress_)};
  }

 private:
  // Puts together what is here without a gap.
  absl::Status Advance() {
    while (!is_done() && waiting_[progress_.num_parts].has_value()) {
      const std::string bytes = *std::exchange(waiting_[progress_.num_parts], std::nullopt);
      TESSERA_RETURN_IF_ERROR(AddPart(bytes));
      progress_.part_bytes += bytes.size();
      ++progress_.num_parts;
      stopped_ = on_part_ && on_part_(assembler_->tile_set(), progress_) == AfterPart::kStop;
    }
    return absl::OkStatus();
  }

  absl::Status AddPart(const std::string& bytes) {
    if (assembler_.has_value()) {
      return assembler_->Add(std::as_bytes(std::span(bytes)));
    }
    TESSERA_ASSIGN_OR_RETURN(TileSetAssembler assembler,
                             TileSetAssembler::Begin(std::as_bytes(std::span(bytes))));
    const TileSet& tile_set = assembler.tile_set();
    const bool are_tiles = assembler.tiles() == needs_.tiles ||
                           (assembler.tiles().empty() && needs_.tiles.size() == tile_set.tile_codes.size());
    const auto is = [](uint32_t planned, auto got) { return std::cmp_equal(planned, got); };
    if (!are_tiles || !is(plan().tile_size(), tile_set.tile_size) ||
        !is(plan().num_btfels(), tile_set.btfels.size()) ||
        !is(plan().num_coefficients(), tile_set.btfels.num_coefficients)) {
      return absl::DataLossError(
          absl::StrCat("the first part has ", tile_set.btfels.size(), " BTFels of ",
                       tile_set.btfels.num_coefficients, " coefficients for ",
                       assembler.tiles().empty() ? tile_set.tile_codes.size() : assembler.tiles().size(),
                       " tiles of ", tile_set.tile_size, " texels a side: not what was asked for"));
    }
    assembler_ = std::move(assembler);
    return absl::OkStatus();
  }

  const SceneNeeds& needs_;
  const OnPart& on_part_;
  const BlobCache& cache_;
  StreamProgress progress_;
  std::optional<TileSetAssembler> assembler_;
  std::vector<std::optional<std::string>> waiting_;  // [parts], whole, not put together yet
  std::string coming_;                               // of part coming_part_
  size_t coming_part_ = 0;
  bool stopped_ = false;
};

// What one call brings. OK also when it was only a plan, a new one or the first: then num_plans has grown.
absl::Status ReadStream(v1::TileSets::Stub& stub, const v1::StreamTileSetRequest& request, Assembly& assembly,
                        int& num_plans, const RunContext& context) {
  StoppableCall call(context);
  const std::unique_ptr<grpc::ClientReader<v1::TileSetChunk>> stream =
      stub.StreamTileSet(call.rpc(), request);
  v1::TileSetChunk chunk;
  absl::Status local;
  bool is_first = true;
  bool is_replaced = false;
  const uint64_t total = assembly.BytesToCome();
  uint64_t received = 0;
  while (local.ok() && stream->Read(&chunk)) {
    assembly.Count(chunk.ByteSizeLong());
    if (is_first) {
      is_first = false;
      if (!assembly.has_plan() || !IsSamePlan(assembly.plan(), chunk.plan())) {
        // Asked for with parts of another plan in mind: the next call asks anew.
        is_replaced = assembly.has_plan();
        local = ++num_plans > kMostPlans
                    ? absl::AbortedError("the tile set is replaced again and again while it is streamed")
                    : assembly.Take(chunk.plan());
        if (is_replaced || assembly.is_done()) {
          break;
        }
      }
      continue;
    }
    local = chunk.has_plan() ? absl::DataLossError("the server sent a second plan") : assembly.Receive(chunk);
    received += chunk.data().size();
    context.Report("streaming", received, total, "bytes");
    if (assembly.is_done()) {
      break;
    }
  }
  if (!local.ok() || assembly.is_done() || is_replaced) {
    call.rpc()->TryCancel();  // there is more that nobody reads
  }
  const grpc::Status status = stream->Finish();
  assembly.DropHalfPart();
  TESSERA_RETURN_IF_ERROR(local);
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  return assembly.is_done() || is_replaced ? absl::OkStatus() : StatusFromGrpc(status);
}

}  // namespace

absl::StatusOr<StreamedTileSet> Client::StreamTileSet(std::string_view name, const SceneNeeds& asked,
                                                      const OnPart& on_part, const RunContext& context) {
  if (asked.level < 0) {
    return absl::InvalidArgumentError(absl::StrCat("level ", asked.level, ", expected 0 or more"));
  }
  SceneNeeds needs = asked;
  std::ranges::sort(needs.tiles);
  needs.tiles.erase(std::ranges::unique(needs.tiles).begin(), needs.tiles.end());
  const BlobCache cache(options_.cache_folder, options_.cache_limit_bytes);
  Assembly assembly(needs, on_part, cache);
  v1::StreamTileSetRequest request;
  request.set_name(std::string(name));
  *request.mutable_needs() = MessageOfNeeds(needs);
  Backoff backoff(options_.retry, context);
  int num_plans = 0;
  while (true) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    request.set_plan_only(!assembly.has_plan());
    request.clear_held_parts();
    size_t num_held = 0;
    for (int part = 0; part < assembly.plan().parts_size(); ++part) {
      if (assembly.HasPart(static_cast<size_t>(part))) {
        request.add_held_parts(static_cast<uint32_t>(part));
        ++num_held;
      }
    }
    const int plans_before = num_plans;
    const size_t parts_before = assembly.num_parts();
    const absl::Status status = ReadStream(*stubs_->tile_sets, request, assembly, num_plans, context);
    if (assembly.is_done() && status.ok()) {
      return std::move(assembly).Finish();
    }
    if (status.ok() && num_plans > plans_before) {
      continue;  // the plan is here, now for its parts
    }
    if (status.ok()) {
      return absl::DataLossError(absl::StrCat("the server ended the stream of ", request.name(), " after ",
                                              num_held, " of ", assembly.plan().parts_size(), " parts"));
    }
    if (!absl::IsUnavailable(status)) {
      return status;
    }
    if (assembly.num_parts() > parts_before) {
      backoff.Reset();
    }
    TESSERA_RETURN_IF_ERROR(backoff.Wait(status));
  }
}

}  // namespace tessera
