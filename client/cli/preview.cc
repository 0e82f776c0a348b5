// tessera preview
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/image/animated_png.h"
#include "btf/image/image_io.h"
#include "client/cli/commands.h"
#include "client/cli/contact_sheet.h"
#include "client/cli/exit_codes.h"
#include "client/cli/preview_request.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

// A mesh or a dressing.
struct Surface {
  std::string name;  // without folder and ending
  std::string path;
  std::optional<std::string> builtin;
  bool is_dressing = false;
};

// One picture: of a tile set on a surface.
struct Cell {
  size_t surface = 0;
  std::string tile_set;  // in full
  std::string path;
  std::string caption;
};

absl::StatusOr<std::vector<Surface>> SurfacesOf(const PreviewFlags& flags) {
  std::vector<Surface> surfaces;
  for (const std::string& path : flags.dressings) {
    surfaces.push_back(
        {.name = std::filesystem::path(path).stem().string(), .path = path, .is_dressing = true});
  }
  for (const std::string& mesh : flags.meshes) {
    const std::optional<std::string> builtin = BuiltinName(mesh);
    surfaces.push_back({.name = builtin.value_or(std::filesystem::path(mesh).stem().string()),
                        .path = mesh,
                        .builtin = builtin});
  }
  std::set<std::string> names;
  for (const Surface& surface : surfaces) {
    if (!names.insert(surface.name).second) {
      return UsageError(fmt::format("two meshes are called {}: their pictures would be too", surface.name));
    }
  }
  return surfaces;
}

// The output path, with what tells apart before its ending: F-TORUS-SURFACE-96-WOOL.png.
std::string PathWith(const std::string& output, const std::string& suffix) {
  const std::filesystem::path path(output);
  return (path.parent_path() / (path.stem().string() + suffix + path.extension().string())).string();
}

absl::StatusOr<std::vector<Cell>> CellsOf(const PreviewFlags& flags, const std::vector<Surface>& surfaces) {
  std::vector<Cell> cells;
  for (size_t i = 0; i < surfaces.size(); ++i) {
    for (const std::string& tile_set : flags.tile_sets) {
      Cell cell{.surface = i};
      TESSERA_ASSIGN_OR_RETURN(cell.tile_set, FullTileSetName(tile_set));
      std::string suffix;
      if (surfaces.size() > 1) {
        suffix += "-" + surfaces[i].name;
        cell.caption = surfaces[i].name;
      }
      if (flags.tile_sets.size() > 1 || surfaces.size() == 1) {
        cell.caption += (cell.caption.empty() ? "" : "  ") + ShortName(cell.tile_set);
      }
      if (flags.tile_sets.size() > 1) {
        suffix += "-" + ShortName(cell.tile_set);
        std::replace(suffix.begin(), suffix.end(), '/', '-');
      }
      cell.path = PathWith(flags.output, suffix);
      cells.push_back(std::move(cell));
    }
  }
  return cells;
}

absl::Status SetSurface(Client& client, const Surface& surface, const RunContext& context,
                        v1::RenderPreviewRequest& request) {
  if (surface.builtin.has_value()) {
    request.set_builtin(*surface.builtin);
    return absl::OkStatus();
  }
  TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client.UploadFile(surface.path, context));
  if (surface.is_dressing) {
    request.set_dressing_sha256(blob.sha256());
  } else {
    request.set_mesh_sha256(blob.sha256());
  }
  return absl::OkStatus();
}

struct Answer {
  Json files = Json::array();
  std::string text;

  absl::Status Write(const std::string& path, std::string_view bytes, Json about) {
    TESSERA_RETURN_IF_ERROR(WriteFileAtomically(path, bytes));
    about["file"] = path;
    files.push_back(std::move(about));
    text += fmt::format("{}{}", text.empty() ? "" : "\n", path);
    return absl::OkStatus();
  }
};

// All frames are drawn before the first is written, so that a cancelled turntable leaves nothing.
absl::Status WriteTurntable(const PreviewFlags& flags, const std::string& tile_set,
                            std::span<const std::string> frames, Answer& answer) {
  const Json about = {{"tile_set", ShortName(tile_set)}};
  if (flags.animated) {
    TESSERA_ASSIGN_OR_RETURN(const std::string animation,
                             AnimatedPng(frames, {.frames_per_second = flags.frames_per_second}));
    return answer.Write(flags.output, animation, about);
  }
  for (size_t i = 0; i < frames.size(); ++i) {
    TESSERA_RETURN_IF_ERROR(answer.Write(PathWith(flags.output, fmt::format("-{:03}", i)), frames[i], about));
  }
  return absl::OkStatus();
}

absl::Status WriteSheet(const PreviewFlags& flags, const std::vector<Cell>& cells,
                        const std::vector<std::string>& pngs, Answer& answer) {
  std::vector<Image> pictures;
  std::vector<std::string> captions;
  for (size_t i = 0; i < cells.size(); ++i) {
    TESSERA_ASSIGN_OR_RETURN(pictures.emplace_back(),
                             DecodeImage(std::as_bytes(std::span(pngs[i])), cells[i].caption, std::nullopt));
    captions.push_back(cells[i].caption);
  }
  // A row a mesh, where there are several of both.
  const bool is_table = cells.back().surface > 0 && flags.tile_sets.size() > 1;
  const int columns =
      flags.columns > 0 || !is_table ? flags.columns : static_cast<int>(flags.tile_sets.size());
  TESSERA_ASSIGN_OR_RETURN(const Image sheet, ContactSheet(pictures, columns, captions));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, EncodePng(sheet));
  Json shown = Json::array();
  for (const Cell& cell : cells) {
    shown.push_back(ShortName(cell.tile_set));
  }
  return answer.Write(flags.output, bytes, {{"tile_sets", shown}});
}

absl::Status RunPreview(Session& session, const PreviewFlags& flags) {
  TESSERA_RETURN_IF_ERROR(CheckPreviewFlags(flags));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Surface> surfaces, SurfacesOf(flags));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Cell> cells, CellsOf(flags, surfaces));
  TESSERA_ASSIGN_OR_RETURN(v1::RenderPreviewRequest base, PreviewRequest(flags));

  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  if (base.has_environment()) {
    TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client->UploadFile(flags.environment, context));
    base.mutable_environment()->set_sha256(blob.sha256());
  }
  std::vector<v1::RenderPreviewRequest> on_surface(surfaces.size(), base);
  for (size_t i = 0; i < surfaces.size(); ++i) {
    TESSERA_RETURN_IF_ERROR(SetSurface(*client, surfaces[i], context, on_surface[i]));
  }
  const size_t frames = std::max(flags.turntable, 1);
  const size_t num_pictures = cells.size() * frames;
  // The server's progress is told for a single picture, how many are drawn for several.
  const RunContext of_picture = num_pictures == 1 ? context : RunContext{.stop = context.stop};
  Answer answer;
  std::vector<std::string> pictures;
  for (size_t i = 0; i < num_pictures; ++i) {
    const Cell& cell = cells[i / frames];
    if (num_pictures > 1) {
      context.Report("rendering", i, num_pictures, "pictures");
    }
    v1::RenderPreviewRequest request = on_surface[cell.surface];
    request.set_tile_set(cell.tile_set);
    if (flags.turntable > 0) {
      request = TurntableRequest(request, static_cast<int>(i), flags.turntable);
    }
    TESSERA_ASSIGN_OR_RETURN(std::string bytes, client->RenderPreview(request, of_picture));
    if (flags.turntable > 0 || flags.sheet) {
      pictures.push_back(std::move(bytes));
    } else {
      TESSERA_RETURN_IF_ERROR(answer.Write(cell.path, bytes, {{"tile_set", ShortName(cell.tile_set)}}));
    }
    context.Report("rendering", i + 1, num_pictures, "pictures");
  }
  if (flags.turntable > 0) {
    TESSERA_RETURN_IF_ERROR(WriteTurntable(flags, cells[0].tile_set, pictures, answer));
  } else if (flags.sheet) {
    TESSERA_RETURN_IF_ERROR(WriteSheet(flags, cells, pictures, answer));
  }
  const std::vector<StageTime> stages = session.FinishStages();
  session.Answer({{"width", base.width()},
                  {"height", base.height()},
                  {"files", answer.files},
                  {"stages", Session::JsonOfStages(stages)}},
                 answer.text);
  return absl::OkStatus();
}

void AddLightOptions(CLI::App& command, PreviewFlags& flags) {
  command
      .add_option(
          "--light", flags.lights,
          "TH,PH[,SCALE] in degrees, from +z (towards the viewer) and from +x towards +y; or "
          "point:X,Y,Z[,SCALE]. SCALE multiplies an irradiance of pi (of a point: at distance 1); three "
          "are red, green, blue. Repeat for up to 64 lights [one over the viewer's left shoulder]")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command.add_option(
      "--env", flags.environment,
      "Light from all around: a Radiance or OpenEXR picture, equirectangular (2:1) or an angular "
      "map (1:1); beside --light, and in place of the usual one");
  command
      .add_option("--env-lights", flags.environment_lights,
                  "As that many lights by importance, 1 to 1000, which --shadows shadows [50 with --shadows]")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--env-order", flags.environment_order,
                  "In the frequency domain, as ORDER squared spherical harmonics, ORDER 1 to 7, which "
                  "nothing shadows [5 "
                  "without --shadows]")
      ->check(CLI::PositiveNumber);
  command.add_option("--env-rotation", flags.environment_rotation_deg,
                     "Degrees about the vertical, counter-clockwise seen from above [0]");
  command.add_option("--env-scale", flags.environment_scale, "Of its radiance [1]")
      ->check(CLI::PositiveNumber);
  command.add_flag("--shadows", flags.shadows, "Shadows of the mesh on itself");
  command.add_option("--shadow-map", flags.shadow_map,
                     "Texels on a side of a light's shadow map, 64 to 2048: finer edges [1024]");
  command.add_option("--exposure", flags.exposure_stops, "Stops, -20 to 20: each doubles the light")
      ->capture_default_str();
  command
      .add_option(
          "--tone", flags.tone,
          "Curve from light to PNG: none clips at 1; reinhard (extended, of luminance); filmic (a fit of "
          "the ACES curve)")
      ->check(CLI::IsMember({"none", "reinhard", "filmic"}))
      ->capture_default_str();
  command.add_option("--white", flags.white, "What reinhard shows as white, after exposure [4]");
  command.add_option("--background", flags.background, "transparent, or sRGB as in ffffff")
      ->capture_default_str();
}

void AddCameraOptions(CLI::App& command, PreviewFlags& flags) {
  command.add_option("--eye", flags.eye, "X,Y,Z: look from there [from the front, all in the frame]");
  command.add_option("--target", flags.target, "X,Y,Z: at that [0,0,0]");
  command.add_option("--up", flags.up, "X,Y,Z: with that upwards [0,1,0]");
  command.add_option("--orbit", flags.orbit,
                     "AZ,EL[,DISTANCE]: look from AZ degrees off the front towards +x, EL above the horizon; "
                     "DISTANCE 1 frames the mesh from every side");
  command.add_option("--fov", flags.fov_deg, "Field of view from bottom to top, degrees, 0.1 to 170 [35]");
}

void AddSeveralOptions(CLI::App& command, PreviewFlags& flags) {
  command.add_flag("--sheet", flags.sheet, "All pictures as one, with captions; a row a mesh");
  command.add_option("--columns", flags.columns, "Pictures a row of the sheet")
      ->check(CLI::NonNegativeNumber);
  constexpr int kMostFrames = 999;
  command
      .add_option(
          "--turntable", flags.turntable,
          "That many pictures of the mesh turning once before camera and lights: F-000.png, F-001.png, ..")
      ->check(CLI::Range(2, kMostFrames));
  command.add_flag("--animated", flags.animated, "Turntable as one animated PNG, F.png or F.apng");
  command.add_option("--fps", flags.frames_per_second, "Its pictures a second")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
}

}  // namespace

void AddPreviewCommand(CLI::App& app, Session& session) {
  const auto flags = std::make_shared<PreviewFlags>();
  CLI::App* command = app.add_subcommand(
      "preview", "Pictures of dressed meshes in each of the tile sets, rendered by the server");
  command->add_option("TILESET", flags->tile_sets, "ARRANGEMENT/NAME; several share the meshes")->required();
  const auto repeated = [&](const char* name, std::vector<std::string>& values, const char* help) {
    command->add_option(name, values, help)
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  };
  repeated("--dressing", flags->dressings, "File of `mesh dress`; repeat for more");
  repeated(
      "--mesh", flags->meshes,
      "OBJ or OFF file, or builtin:plane, torus, cube-sphere, genus3, dressed on the way; repeat for more");
  command->add_option("--seed", flags->seed, "Of that dressing")->capture_default_str();
  AddLightOptions(*command, *flags);
  AddCameraOptions(*command, *flags);
  command->add_option("--size", flags->size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  command
      ->add_option(
          "--mips", flags->mips,
          "Mip levels, against noise where pixels are larger than texels: on, off, or auto, on from four "
          "texels a pixel's side")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->capture_default_str();
  AddSeveralOptions(*command, *flags);
  command
      ->add_option(
          "-o,--output", flags->output,
          "File to write, .png (sRGB) or .exr (linear); F.png becomes F-MESH-ARRANGEMENT-NAME.png for "
          "each of several meshes and tile sets")
      ->required();
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunPreview(session, *flags); }; });
}

}  // namespace tessera::cli
