#include "client/cli/pull.h"

#include <memory>
#include <optional>
#include <span>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/render/preview_scene.h"
#include "btf/wang/dressing.h"
#include "btf/wang/scene_needs.h"
#include "client/cli/describe.h"
#include "client/cli/exit_codes.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

static_assert(kLevelBias == kMipBias, "levels are sent for our own renderer, too");

struct PullFlags {
  std::string name;
  std::string output;
  std::string dressing;
  std::optional<int> level;
  std::optional<double> pixels_per_quad;
  std::optional<double> max_error;
  std::optional<uint64_t> max_bytes;
  std::optional<std::string> light;

  [[nodiscard]] bool AskForLess() const {
    return !dressing.empty() || level || pixels_per_quad || max_error || max_bytes || light;
  }
};

absl::StatusOr<SceneNeeds> NeedsOfFlags(const PullFlags& flags, const v1::TileSet& tile_set) {
  SceneNeeds needs;
  if (!flags.dressing.empty()) {
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(flags.dressing));
    TESSERA_ASSIGN_OR_RETURN(const Dressing dressing, ParseDressing(std::as_bytes(std::span(bytes))));
    if (dressing.arrangement_sha256 != tile_set.arrangement_sha256()) {
      return absl::FailedPreconditionError(fmt::format(
          "{} is a dressing of {} (sha256 {}), {} has sha256 {}", flags.dressing, dressing.arrangement_id,
          dressing.arrangement_sha256, ShortName(tile_set.name()), tile_set.arrangement_sha256()));
    }
    needs = NeedsOfDressing(dressing);
  }
  const auto tile_size = static_cast<int>(tile_set.tile_size());
  if (flags.pixels_per_quad) {
    TESSERA_ASSIGN_OR_RETURN(needs.level, LevelForPixels(tile_size, *flags.pixels_per_quad));
  }
  needs.level = flags.level.value_or(needs.level);
  needs.max_error = flags.max_error;
  needs.max_bytes = flags.max_bytes;
  needs.light = FindSceneLight(flags.light.value_or("point")).value_or(SceneLight::kPoint);
  TESSERA_RETURN_IF_ERROR(CheckNeeds(needs, tile_set.num_tiles(), tile_size));
  return needs;
}

Json DescribeStream(const StreamProgress& progress, const SceneNeeds& needs, double share) {
  const v1::TileSetPlan& plan = progress.plan;
  Json parts = Json::array();
  for (const v1::TileSetPart& part : plan.parts()) {
    parts.push_back({{"size_bytes", part.size_bytes()},
                     {"num_coefficients", part.num_coefficients()},
                     {"rmse", part.rmse()}});
  }
  return {{"num_tiles", plan.num_tiles()},
          {"level", needs.level},
          {"tile_size", plan.tile_size()},
          {"num_btfels", plan.num_btfels()},
          {"num_coefficients", plan.parts(static_cast<int>(progress.num_parts) - 1).num_coefficients()},
          {"of_coefficients", plan.num_coefficients()},
          {"light", std::string(SceneLightName(needs.light))},
          {"rmse", progress.rmse()},
          {"level_rmse", plan.level_rmse()},
          {"directions", plan.directions()},
          {"part_bytes", progress.part_bytes},
          {"moved_bytes", progress.moved_bytes},
          {"tile_set_bytes", plan.tile_set_bytes()},
          {"share", share},
          {"parts", std::move(parts)}};
}

std::string TextOfStream(const std::string& output, const v1::TileSet& tile_set, const Json& stream) {
  const auto bytes = [&stream](const char* key) {
    return FormatAmount(static_cast<double>(stream[key].get<uint64_t>()), "bytes");
  };
  return fmt::format(
      "{}\n{} of {} tiles at level {}: {} BTFels, {} of {} coefficients\n"
      "moved {} for {}, {:.2f}% of the whole set's {}\nerror {:.5f} (RMSE over {}), of the level {:.5f}",
      output, stream["num_tiles"].get<uint64_t>(), tile_set.num_tiles(), stream["level"].get<int>(),
      stream["num_btfels"].get<uint64_t>(), stream["num_coefficients"].get<uint64_t>(),
      stream["of_coefficients"].get<uint64_t>(), bytes("moved_bytes"), bytes("part_bytes"),
      100.0 * stream["share"].get<double>(), bytes("tile_set_bytes"), stream["rmse"].get<double>(),
      stream["directions"].get<std::string>(), stream["level_rmse"].get<double>());
}

absl::Status PullNeeds(Session& session, Client& client, const PullFlags& flags,
                       const v1::TileSet& tile_set) {
  TESSERA_ASSIGN_OR_RETURN(const SceneNeeds needs, NeedsOfFlags(flags, tile_set));
  TESSERA_ASSIGN_OR_RETURN(const StreamedTileSet streamed,
                           client.StreamTileSet(tile_set.name(), needs, {}, session.Context()));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, SerializeTileSet(streamed.tile_set));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, bytes));
  session.FinishStages();
  const StreamProgress& progress = streamed.progress;
  const double share =
      static_cast<double>(progress.part_bytes) / static_cast<double>(progress.plan.tile_set_bytes());
  const Json stream = DescribeStream(progress, needs, share);
  session.Answer({{"file", flags.output}, {"tile_set", Describe(tile_set)}, {"stream", stream}},
                 TextOfStream(flags.output, tile_set, stream));
  return absl::OkStatus();
}

absl::Status RunPull(Session& session, const PullFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(flags.name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, client->GetTileSet(full_name, context));
  if (flags.AskForLess()) {
    return PullNeeds(session, *client, flags, tile_set);
  }
  TESSERA_RETURN_IF_ERROR(client->DownloadFile(tile_set.blob(), flags.output, context));
  session.FinishStages();
  session.Answer({{"file", flags.output}, {"tile_set", Describe(tile_set)}}, flags.output);
  return absl::OkStatus();
}

}  // namespace

void AddPull(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<PullFlags>();
  CLI::App* command = noun.add_subcommand("pull", "Download a tile set, or only what a scene needs of it");
  command->add_option("TILESET", flags->name, "ARRANGEMENT/NAME")->required();
  command->add_option("-o,--output", flags->output, "File to write, .tsra")->required();
  command->add_option("--for-dressing", flags->dressing,
                      "Only the tiles that this dressing shows: file of `mesh dress`");
  CLI::Option* level = command->add_option(
      "--level", flags->level, "Only what this mip level and those above it show, 0 the tile set itself");
  command
      ->add_option("--pixels-per-quad", flags->pixels_per_quad,
                   "Only the coarsest mip level from which quads so many pixels wide look as from all")
      ->excludes(level);
  command->add_option("--max-error", flags->max_error,
                      "Only as much as it takes: RMSE in reflectance against all of it");
  command
      ->add_option("--max-bytes", flags->max_bytes,
                   "Only as many as fit in these bytes, or with a unit: 400KB, 2MiB")
      ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true));
  command->add_option("--light", flags->light, "Light of the scene, for errors and what comes first [point]")
      ->check(CLI::IsMember({"point", "environment"}));
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunPull(session, *flags); }; });
}

}  // namespace tessera::cli
