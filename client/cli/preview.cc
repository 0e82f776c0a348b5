// tessera preview
#include <algorithm>
#include <filesystem>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/exit_codes.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

struct PreviewFlags {
  std::vector<std::string> tile_sets;
  std::string dressing;
  std::string mesh;
  uint64_t seed = 1;
  std::vector<std::string> lights;
  std::string size = "640x480";
  std::string mips = "auto";
  std::string output;
};

// With one tile set the output path itself; with several, the tile set's name goes before the ending.
std::string OutputPath(const PreviewFlags& flags, const std::string& tile_set_name) {
  if (flags.tile_sets.size() == 1) {
    return flags.output;
  }
  std::string name = ShortName(tile_set_name);
  std::replace(name.begin(), name.end(), '/', '-');
  const std::filesystem::path output(flags.output);
  return (output.parent_path() / (output.stem().string() + "-" + name + output.extension().string()))
      .string();
}

absl::Status RunPreview(Session& session, const PreviewFlags& flags) {
  if (flags.dressing.empty() == flags.mesh.empty()) {
    return UsageError("preview takes either --dressing or --mesh");
  }
  std::vector<std::string> names;
  for (const std::string& tile_set : flags.tile_sets) {
    TESSERA_ASSIGN_OR_RETURN(names.emplace_back(), FullTileSetName(tile_set));
  }
  v1::RenderPreviewRequest request;
  TESSERA_ASSIGN_OR_RETURN(const PictureSize size, ParsePictureSize(flags.size));
  request.set_width(size.width);
  request.set_height(size.height);
  for (const std::string& light : flags.lights) {
    TESSERA_ASSIGN_OR_RETURN(*request.add_lights(), ParseLight(light));
  }
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PictureFormatOf(flags.output));
  request.set_format(format == PictureFormat::kPng ? v1::RenderPreviewRequest::PNG
                                                   : v1::RenderPreviewRequest::EXR);
  request.set_seed(flags.seed);
  request.set_mips(flags.mips == "on"    ? v1::RenderPreviewRequest::ON
                   : flags.mips == "off" ? v1::RenderPreviewRequest::OFF
                                         : v1::RenderPreviewRequest::AUTO);

  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  if (!flags.dressing.empty()) {
    TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client->UploadFile(flags.dressing, context));
    request.set_dressing_sha256(blob.sha256());
  } else if (const std::optional<std::string> shape = BuiltinName(flags.mesh)) {
    request.set_builtin(*shape);
  } else {
    TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client->UploadFile(flags.mesh, context));
    request.set_mesh_sha256(blob.sha256());
  }
  Json files = Json::array();
  std::string text;
  for (size_t i = 0; i < names.size(); ++i) {
    context.Report("rendering", i, names.size(), "pictures");
    request.set_tile_set(names[i]);
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, client->RenderPreview(request, context));
    const std::string path = OutputPath(flags, names[i]);
    TESSERA_RETURN_IF_ERROR(WriteFileAtomically(path, bytes));
    files.push_back({{"tile_set", ShortName(names[i])}, {"file", path}});
    text += fmt::format("{}{}", text.empty() ? "" : "\n", path);
    context.Report("rendering", i + 1, names.size(), "pictures");
  }
  const std::vector<StageTime> stages = session.FinishStages();
  session.Answer({{"width", size.width},
                  {"height", size.height},
                  {"files", files},
                  {"stages", Session::JsonOfStages(stages)}},
                 text);
  return absl::OkStatus();
}

}  // namespace

void AddPreviewCommand(CLI::App& app, Session& session) {
  const auto flags = std::make_shared<PreviewFlags>();
  CLI::App* command = app.add_subcommand(
      "preview", "A picture of a dressed mesh in each of the tile sets, rendered by the server");
  command->add_option("TILESET", flags->tile_sets, "ARRANGEMENT/NAME; several share the dressing")
      ->required();
  command->add_option("--dressing", flags->dressing, "File of `mesh dress`");
  command->add_option(
      "--mesh", flags->mesh,
      "Or an OBJ or OFF file, or builtin:plane, torus, cube-sphere, genus3, dressed on the way");
  command->add_option("--seed", flags->seed, "Of that dressing")->capture_default_str();
  command
      ->add_option("--light", flags->lights,
                   "TH,PH[,SCALE] in degrees, from +z (towards the viewer) and from +x towards +y; or "
                   "point:X,Y,Z[,SCALE]. SCALE multiplies an irradiance of pi (of a point: at distance 1). "
                   "Repeat for more lights [one over the viewer's left shoulder]")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("--size", flags->size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  command
      ->add_option(
          "--mips", flags->mips,
          "Mip levels, against noise where pixels are larger than texels: on, off, or auto, on from two "
          "texels a pixel")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->capture_default_str();
  command
      ->add_option(
          "-o,--output", flags->output,
          "File to write, .png (sRGB) or .exr (linear); F.png becomes F-ARRANGEMENT-NAME.png for each "
          "of several tile sets")
      ->required();
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunPreview(session, *flags); }; });
}

}  // namespace tessera::cli
