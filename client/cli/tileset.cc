// tessera tileset synthesize | list | show | pull | certify | sheet | thumbnail | mips | delete
#include <memory>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"
#include "btf/mips/tile_mips.h"
#include "btf/render/sheet.h"
#include "btf/tiles/synthesize.h"
#include "client/cli/arguments.h"
#include "client/cli/certificate.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/cli/exit_codes.h"
#include "client/cli/mask.h"
#include "client/cli/pattern.h"
#include "client/cli/pull.h"
#include "client/lib/names.h"
#include "proto/wire/names.h"
#include "proto/wire/status.h"

namespace tessera::cli {
namespace {

struct SynthesizeFlags {
  std::string material;
  std::string arrangement;
  std::string name;
  uint32_t tile_size = 0;
  uint32_t strip_height = 0;
  uint64_t seed = 1;
  uint32_t effort = 1;
  std::string method = "frame";
  std::string recipe;
  bool force = false;
  bool detach = false;
  bool replace = false;
};

std::string SummaryOf(const v1::TileSet& tile_set) {
  return fmt::format("{}: {} tiles of {}x{} texels, strips {} high, {} BTFels, {}",
                     ShortName(tile_set.name()), tile_set.num_tiles(), tile_set.tile_size(),
                     tile_set.tile_size(), tile_set.strip_height(), tile_set.num_btfels(),
                     FormatAmount(static_cast<double>(tile_set.blob().size_bytes()), "bytes"));
}

void WarnOfSeams(Session& session, const Json& tile_set) {
  for (const std::string& warning : CertificateWarnings(tile_set["certificate"])) {
    session.Warn(fmt::format("{}: {}", tile_set["name"].get<std::string>(), warning));
  }
}

// What synthesis has to say of the sizes, a sentence each.
void TellOfSizes(Session& session, const Json& tile_set) {
  const auto sentences_at = [&](const char* place) {
    std::vector<std::string> sentences;
    for (const Json& line : tile_set.value(Json::json_pointer(place), Json::array())) {
      sentences.push_back(fmt::format("{}: {}", tile_set["name"].get<std::string>(),
                                      line.is_string() ? line.get<std::string>() : line.dump()));
    }
    return sentences;
  };
  for (const std::string& note : sentences_at("/metadata/notes")) {
    session.Note(note);
  }
  for (const std::string& warning : sentences_at("/metadata/warnings")) {
    session.Warn(warning);
  }
}

absl::Status RunSynthesize(Session& session, const SynthesizeFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string material, FullMaterialName(flags.material));
  const std::string own_name = flags.name.empty() ? ShortName(material) : flags.name;
  TESSERA_ASSIGN_OR_RETURN(const std::string name, FullTileSetName(flags.arrangement + "/" + own_name));
  std::string recipe_json;
  if (!flags.recipe.empty()) {
    TESSERA_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipeFile(flags.recipe));
    recipe_json = recipe.json.dump();
  }
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  v1::SynthesizeTileSetRequest request;
  request.set_name(name);
  request.set_material(material);
  request.set_tile_size(flags.tile_size);
  request.set_strip_height(flags.strip_height);
  request.set_seed(flags.seed);
  request.set_effort(flags.effort);
  request.set_method(flags.method);
  request.set_recipe_json(recipe_json);
  request.set_force(flags.force);
  request.set_replace(flags.replace);
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client->SynthesizeTileSet(request, context));
  if (flags.detach) {
    session.Answer(Describe(job), ShortName(job.name()));
    return absl::OkStatus();
  }
  TESSERA_ASSIGN_OR_RETURN(const v1::Job ended, client->WaitForJob(job.name(), OnStop::kCancelJob, context));
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, client->GetTileSet(ended.result_name(), context));
  const std::vector<StageTime> stages = session.FinishStages();
  const Json described = Describe(tile_set);
  std::string text = SummaryOf(tile_set);
  if (const std::string pattern =
          PatternText(described.value(Json::json_pointer("/metadata/pattern"), Json::object()));
      !pattern.empty()) {
    text += fmt::format("\n{}", pattern);
  }
  double total = 0;
  for (const StageTime& stage : stages) {
    text += fmt::format("\n{:<12} {:8.2f} s", stage.stage, stage.seconds);
    total += stage.seconds;
  }
  text += fmt::format("\n{:<12} {:8.2f} s", "in all", total);
  session.Answer(
      {{"tile_set", described}, {"stages", Session::JsonOfStages(stages)}, {"job", ShortName(job.name())}},
      fmt::format("{}\n{}", text, CertificateText(described["certificate"])));
  TellOfSizes(session, described);
  WarnOfSeams(session, described);
  return absl::OkStatus();
}

absl::Status ListTileSets(Session& session, const std::string& arrangement) {
  std::string parent;
  if (!arrangement.empty()) {
    TESSERA_ASSIGN_OR_RETURN(parent, FullArrangementName(arrangement));
  }
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const std::vector<v1::TileSet> tile_sets,
                           client->ListTileSets(parent, session.Context()));
  Json all = Json::array();
  std::vector<std::vector<std::string>> rows = {{"TILE SET", "TILES", "TEXELS", "STRIP", "BTFELS", "SIZE"}};
  for (const v1::TileSet& tile_set : tile_sets) {
    all.push_back(Describe(tile_set));
    rows.push_back({ShortName(tile_set.name()), std::to_string(tile_set.num_tiles()),
                    fmt::format("{}x{}", tile_set.tile_size(), tile_set.tile_size()),
                    std::to_string(tile_set.strip_height()), std::to_string(tile_set.num_btfels()),
                    FormatAmount(static_cast<double>(tile_set.blob().size_bytes()), "bytes")});
  }
  session.Answer({{"tile_sets", std::move(all)}}, TextTable(rows));
  return absl::OkStatus();
}

absl::Status ShowTileSet(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, client->GetTileSet(full_name, session.Context()));
  session.Answer(Describe(tile_set), TextRecord(Describe(tile_set)));
  return absl::OkStatus();
}

struct CertifyFlags {
  std::string name;
  bool all_images = false;
};

absl::Status RunCertify(Session& session, const CertifyFlags& flags) {
  v1::CertifyTileSetRequest request;
  TESSERA_ASSIGN_OR_RETURN(*request.mutable_name(), FullTileSetName(flags.name));
  request.set_all_images(flags.all_images);
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client->CertifyTileSet(request, context));
  TESSERA_ASSIGN_OR_RETURN(const v1::Job ended, client->WaitForJob(job.name(), OnStop::kCancelJob, context));
  TESSERA_ASSIGN_OR_RETURN(const v1::TileSet tile_set, client->GetTileSet(ended.result_name(), context));
  session.FinishStages();
  const Json described = Describe(tile_set);
  session.Answer({{"name", described["name"]},
                  {"certificate", described["certificate"]},
                  {"ratio_limit", kSeamRatioLimit}},
                 CertificateText(described["certificate"]));
  WarnOfSeams(session, described);
  return absl::OkStatus();
}

struct TileSetSheetFlags {
  std::string name;
  std::string light = "30,135";
  std::string view = "0,0";
  int columns = 0;
  bool seam_heat = false;
  std::string output;
};

absl::Status RunTileSetSheet(Session& session, const TileSetSheetFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(flags.name));
  SheetParams params;
  TESSERA_ASSIGN_OR_RETURN(params.light, ParseDirection(flags.light));
  TESSERA_ASSIGN_OR_RETURN(params.view, ParseDirection(flags.view));
  params.columns = flags.columns;
  params.seam_heat = flags.seam_heat;
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PictureFormatOf(flags.output));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const TileSet tile_set, client->FetchTileSet(full_name, context));
  TESSERA_ASSIGN_OR_RETURN(const Image sheet, RenderTileSheet(tile_set, params, context));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           format == PictureFormat::kPng ? EncodePng(sheet) : EncodeExr(sheet));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, bytes));
  session.FinishStages();
  session.Answer({{"file", flags.output}, {"width", sheet.width}, {"height", sheet.height}}, flags.output);
  return absl::OkStatus();
}

struct ThumbnailFlags {
  std::string name;
  std::string output;
};

// The job that draws the tile set's thumbnail and has not ended; empty when there is none.
absl::StatusOr<std::string> FindThumbnailJob(Client& client, const TileSetId& id, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<v1::Job> jobs, client.ListJobs(context));
  for (const v1::Job& job : jobs) {
    const bool is_active = job.state() == v1::Job::QUEUED || job.state() == v1::Job::RUNNING;
    if (is_active && job.result_name() == ThumbnailName(id)) {
      return job.name();
    }
  }
  return "";
}

absl::Status RunThumbnail(Session& session, const ThumbnailFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(flags.name));
  TESSERA_ASSIGN_OR_RETURN(const TileSetId id, ParseTileSetName(full_name));
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PictureFormatOf(flags.output));
  if (format != PictureFormat::kPng) {
    return UsageError(fmt::format("-o {}: a thumbnail is a PNG", flags.output));
  }
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(v1::TileSet tile_set, client->GetTileSet(full_name, context));
  if (!tile_set.has_thumbnail()) {
    TESSERA_ASSIGN_OR_RETURN(const std::string job, FindThumbnailJob(*client, id, context));
    if (!job.empty()) {
      TESSERA_RETURN_IF_ERROR(client->WaitForJob(job, OnStop::kLeaveJob, context).status());
    }
    // Also without a job: it may have ended since the first look.
    TESSERA_ASSIGN_OR_RETURN(tile_set, client->GetTileSet(full_name, context));
  }
  if (!tile_set.has_thumbnail()) {
    return WithReason(absl::NotFoundError(fmt::format(
                          "{} has no thumbnail: it comes from an older catalog, or its job failed "
                          "(tessera job list); tessera tileset certify {} makes one",
                          ShortName(full_name), ShortName(full_name))),
                      "NOT_FOUND", full_name);
  }
  TESSERA_RETURN_IF_ERROR(client->DownloadFile(tile_set.thumbnail(), flags.output, context));
  session.FinishStages();
  session.Answer({{"file", flags.output}, {"sha256", tile_set.thumbnail().sha256()}}, flags.output);
  return absl::OkStatus();
}

absl::Status RunMips(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const TileSet tile_set, client->FetchTileSet(full_name, context));
  TESSERA_ASSIGN_OR_RETURN(const TileMips mips, MakeTileMips(tile_set, {}, context));
  const std::vector<StageTime> stages = session.FinishStages();
  const auto bytes_text = [](uint64_t bytes) { return FormatAmount(static_cast<double>(bytes), "bytes"); };
  const uint64_t own_bytes = tile_set.btfels.codes.size() + tile_set.tile_index.size() * sizeof(uint32_t);
  std::vector<std::vector<std::string>> rows = {
      {"LEVEL", "TILE", "TEXELS", "BTFELS", "SIZE", "RMSE"},
      {"0", fmt::format("{0}x{0}", tile_set.tile_size), std::to_string(tile_set.tile_index.size()),
       std::to_string(tile_set.btfels.size()), bytes_text(own_bytes), ""}};
  Json levels = Json::array();
  for (const MipLevel& level : mips.levels) {
    const size_t texels = level.parts.size() / mips.parts_per_texel;
    levels.push_back({{"level", levels.size() + 1},
                      {"tile_size", level.tile_size},
                      {"texels", texels},
                      {"btfels", level.btfels.size()},
                      {"size_bytes", level.size_bytes()},
                      {"quantisation_rmse", level.quantisation_rmse}});
    rows.push_back({std::to_string(levels.size()), fmt::format("{0}x{0}", level.tile_size),
                    std::to_string(texels), std::to_string(level.btfels.size()),
                    bytes_text(level.size_bytes()), fmt::format("{:.6f}", level.quantisation_rmse)});
  }
  std::string text = TextTable(rows);
  for (const StageTime& stage : stages) {
    if (stage.stage == "mips") {
      text += fmt::format("\n{} parts a texel, {}, {:.2f} s", mips.parts_per_texel,
                          bytes_text(mips.size_bytes()), stage.seconds);
    }
  }
  session.Answer({{"name", ShortName(full_name)},
                  {"parts_per_texel", mips.parts_per_texel},
                  {"size_bytes", mips.size_bytes()},
                  {"levels", std::move(levels)},
                  {"stages", Session::JsonOfStages(stages)}},
                 text);
  return absl::OkStatus();
}

absl::Status RunDelete(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_RETURN_IF_ERROR(client->DeleteTileSet(full_name, session.Context()));
  session.Answer({{"deleted", ShortName(full_name)}}, "");
  return absl::OkStatus();
}

void AddSynthesize(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<SynthesizeFlags>();
  CLI::App* command =
      noun.add_subcommand("synthesize", "The tiles of a material in an arrangement, by the server");
  command->add_option("MATERIAL", flags->material, "Name of the material")->required();
  command->add_option("--arrangement", flags->arrangement, "plane-16, plane-81, surface-26, surface-96..")
      ->required();
  command->add_option("--name", flags->name, "Name of the tile set [the material's]");
  command->add_option("--tile", flags->tile_size,
                      "Texels per tile side, at least twice the strip [64; of a regular material in plane-16 "
                      "the nearest size that keeps its period]");
  command->add_option("--strip", flags->strip_height,
                      "Height of the strips in texels: even, from 8 [the material's feature size]");
  command->add_option("--seed", flags->seed, "Same seed, same tile set")->capture_default_str();
  command
      ->add_option("--effort", flags->effort,
                   "How many times as long seams are improved while they show more than the material's own "
                   "steps")
      ->check(CLI::Range(1, kMostEffort))
      ->capture_default_str();
  command
      ->add_option("--method", flags->method,
                   "frame, or a baseline: four diamonds cut by dynamic programming or by a minimum cut")
      ->check(CLI::IsMember({"frame", "diamond-dp", "diamond-cut"}))
      ->capture_default_str();
  command->add_option("--recipe", flags->recipe,
                      "JSON file of features to place, corner samples and colours: btf/tiles/RECIPE.md");
  command->add_flag("--force", flags->force, "Turn strips of a material that is not isotropic all the same");
  command->add_flag("--detach", flags->detach, "Print the job and return at once");
  command->add_flag("--replace", flags->replace, "Take a name that exists");
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunSynthesize(session, *flags); }; });
}

void AddSheet(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<TileSetSheetFlags>();
  CLI::App* command = noun.add_subcommand("sheet", "All tiles side by side in one picture");
  command->add_option("TILESET", flags->name, "ARRANGEMENT/NAME")->required();
  command->add_option("--light", flags->light, "TH,PH in degrees, TH from the normal")->capture_default_str();
  command->add_option("--view", flags->view, "Likewise")->capture_default_str();
  command->add_option("--columns", flags->columns, "Tiles a row [about square]");
  command->add_flag("--heat", flags->seam_heat,
                    "And beside it where seams show: blue not, green 1.25, yellow 1.5, red twice the "
                    "material's own steps");
  command->add_option("-o,--output", flags->output, "File to write, .png (sRGB) or .exr (linear)")
      ->required();
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunTileSetSheet(session, *flags); }; });
}

}  // namespace

void AddTileSetCommands(CLI::App& app, Session& session) {
  CLI::App* noun =
      app.add_subcommand("tileset", "Tiles of a material in an arrangement, named ARRANGEMENT/NAME");
  noun->require_subcommand(1);
  AddSynthesize(*noun, session);

  const auto name = std::make_shared<std::string>();
  const auto arrangement = std::make_shared<std::string>();
  CLI::App* list = noun->add_subcommand("list", "Every tile set");
  list->add_option("--arrangement", *arrangement, "Only those of this arrangement");
  list->callback([&session, arrangement] {
    session.run = [&session, arrangement] { return ListTileSets(session, *arrangement); };
  });

  CLI::App* show = noun->add_subcommand("show", "One tile set, its source and its certificate");
  show->add_option("TILESET", *name, "ARRANGEMENT/NAME")->required();
  show->callback(
      [&session, name] { session.run = [&session, name] { return ShowTileSet(session, *name); }; });

  AddPull(*noun, session);

  const auto certify_flags = std::make_shared<CertifyFlags>();
  CLI::App* certify =
      noun->add_subcommand("certify", "Measure how visible the seams are, again, and keep it");
  certify->add_option("TILESET", certify_flags->name, "ARRANGEMENT/NAME")->required();
  certify->add_flag("--full", certify_flags->all_images,
                    "In every measured image rather than 256 spread over views and lights");
  certify->callback([&session, certify_flags] {
    session.run = [&session, certify_flags] { return RunCertify(session, *certify_flags); };
  });

  AddSheet(*noun, session);

  const auto thumbnail_flags = std::make_shared<ThumbnailFlags>();
  CLI::App* thumbnail = noun->add_subcommand(
      "thumbnail", "The picture of 2 x 2 tiles, 128 x 128 pixels, that the server made of it");
  thumbnail->add_option("TILESET", thumbnail_flags->name, "ARRANGEMENT/NAME")->required();
  thumbnail->add_option("-o,--output", thumbnail_flags->output, "File to write, .png")->required();
  thumbnail->callback([&session, thumbnail_flags] {
    session.run = [&session, thumbnail_flags] { return RunThumbnail(session, *thumbnail_flags); };
  });

  CLI::App* mips = noun->add_subcommand("mips",
                                        "The mip levels that pictures of far objects use: sizes, and how far "
                                        "8 bits take them from exact means");
  mips->add_option("TILESET", *name, "ARRANGEMENT/NAME")->required();
  mips->callback([&session, name] { session.run = [&session, name] { return RunMips(session, *name); }; });

  CLI::App* remove = noun->add_subcommand("delete", "Free the name");
  remove->add_option("TILESET", *name, "ARRANGEMENT/NAME")->required();
  remove->callback(
      [&session, name] { session.run = [&session, name] { return RunDelete(session, *name); }; });
}

}  // namespace tessera::cli
