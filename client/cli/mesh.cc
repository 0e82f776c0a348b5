// tessera mesh dress | redress | info | remesh
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/remesh/remesh.h"
#include "btf/remesh/triangle_mesh_io.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dress.h"
#include "btf/wang/mesh_io.h"
#include "btf/wang/mesh_topology.h"
#include "btf/wang/redress.h"
#include "btf/wang/shapes.h"
#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/cli/exit_codes.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

using Clock = std::chrono::steady_clock;

double MillisecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

std::span<const std::byte> BytesOf(const std::string& text) {
  return std::as_bytes(std::span(text));
}

Json JsonOf(const RemeshReport& report) {
  return {{"num_quads", report.num_quads},
          {"target_quads", report.target_quads},
          {"components_in", report.topology_in.num_components},
          {"components_out", report.topology_out.num_components},
          {"genus_in", report.topology_in.genus},
          {"genus_out", report.topology_out.genus},
          {"area_ratio", {{"mean", report.mean_area_ratio}, {"worst", report.worst_area_ratio}}},
          {"angle_deviation_deg",
           {{"mean", report.mean_angle_deviation_deg}, {"worst", report.worst_angle_deviation_deg}}},
          {"num_flipped", report.num_flipped},
          {"distance_of_diagonal", {{"mean", report.mean_distance}, {"worst", report.worst_distance}}},
          {"num_on_creases", report.num_on_creases},
          {"warnings", report.Warnings()}};
}

std::string TextOf(const RemeshReport& report) {
  return fmt::format(
      "{} quads, genus {} (input {}), angles off 90 degrees by {:.1f} (worst {:.1f}), area ratio {:.2f} "
      "(worst {:.2f}), {} flipped, off the surface by {:.2g} of its box (worst {:.2g})",
      report.num_quads, report.topology_out.genus, report.topology_in.genus, report.mean_angle_deviation_deg,
      report.worst_angle_deviation_deg, report.mean_area_ratio, report.worst_area_ratio, report.num_flipped,
      report.mean_distance, report.worst_distance);
}

absl::StatusOr<RemeshResult> ReadAndRemesh(Session& session, const std::string& path, uint32_t target_quads) {
  TriangleReadNotes notes;
  TESSERA_ASSIGN_OR_RETURN(const TriangleMesh mesh, ReadTriangleMesh(path, &notes));
  if (notes.triangles_turned + notes.faces_fanned + notes.vertices_merged > 0) {
    session.Note(fmt::format("{}: {} triangles turned, {} larger faces split, {} vertices merged", path,
                             notes.triangles_turned, notes.faces_fanned, notes.vertices_merged));
  }
  TESSERA_ASSIGN_OR_RETURN(RemeshResult result,
                           RemeshTriangles(mesh, {.target_quads = target_quads}, session.Context()));
  for (const std::string& warning : result.report.Warnings()) {
    session.Warn(fmt::format("{}: {}", path, warning));
  }
  return result;
}

struct ReadResult {
  QuadMesh mesh;
  bool remeshed = false;  // from triangles
};

// A built-in shape, a file of quads, or a file of triangles or mixed faces remeshed to `target_quads`, 0:
// kDefaultRemeshQuads.
absl::StatusOr<ReadResult> ReadMesh(Session& session, const std::string& mesh, uint32_t target_quads) {
  ReadResult result;
  if (const std::optional<std::string> shape = BuiltinName(mesh)) {
    TESSERA_ASSIGN_OR_RETURN(result.mesh, BuiltinShape(*shape));
    return result;
  }
  const std::string extension = MeshExtension(mesh);
  const bool may_be_quads = extension != ".ply" && extension != ".gltf" && extension != ".glb";
  if (may_be_quads) {
    MeshReadNotes notes;
    absl::StatusOr<QuadMesh> read = ReadQuadMesh(mesh, &notes);
    if (read.ok() && notes.faces_turned + notes.vertices_split + notes.vertices_dropped > 0) {
      session.Note(fmt::format("{}: {} faces turned, {} vertices doubled, {} unused vertices left out", mesh,
                               notes.faces_turned, notes.vertices_split, notes.vertices_dropped));
    }
    if (read.ok() || notes.faces_not_quads == 0) {
      TESSERA_ASSIGN_OR_RETURN(result.mesh, std::move(read));
      return result;
    }
  }
  TESSERA_ASSIGN_OR_RETURN(
      RemeshResult remeshed,
      ReadAndRemesh(session, mesh, target_quads == 0 ? kDefaultRemeshQuads : target_quads));
  session.Note(fmt::format("{}: not of quads, so it was remeshed: {}", mesh, TextOf(remeshed.report)));
  result.mesh = std::move(remeshed.mesh);
  result.remeshed = true;
  return result;
}

struct RemeshFlags {
  std::string input;
  std::string output;
  uint32_t target_quads = kDefaultRemeshQuads;
};

absl::Status RunRemesh(Session& session, const RemeshFlags& flags) {
  if (MeshExtension(flags.output) != ".obj") {
    return UsageError(fmt::format("-o \"{}\": expected a file ending in .obj", flags.output));
  }
  TESSERA_ASSIGN_OR_RETURN(const RemeshResult result,
                           ReadAndRemesh(session, flags.input, flags.target_quads));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, WriteObj(result.mesh)));
  Json value = {{"file", flags.output}};
  value.update(JsonOf(result.report));
  value["stages"] = Session::JsonOfStages(session.FinishStages());
  session.Answer(value, fmt::format("{}: {}", flags.output, TextOf(result.report)));
  return absl::OkStatus();
}

struct DressFlags {
  std::string mesh;
  std::string arrangement;
  uint64_t seed = 1;
  bool allow_breaks = false;
  uint32_t target_quads = 0;
  bool on_server = false;
  std::string output;
};

// How many broken edges are told in words; --json has all that the dressing lists.
constexpr size_t kBreaksInText = 5;

Json JsonOfBreaks(const Dressing& dressing, const std::vector<Break>& breaks) {
  const auto position = [&](const Quad& quad, int corner) {
    const Eigen::Vector3f& at = dressing.mesh.positions[quad[corner & 3]];
    return Json{at.x(), at.y(), at.z()};
  };
  Json list = Json::array();
  for (const Break& broken : breaks) {
    const Quad& quad = dressing.mesh.quads[broken.face];
    list.push_back({{"quads", {broken.face + 1, broken.other_face + 1}},
                    {"from", position(quad, broken.side)},
                    {"to", position(quad, broken.side + 1)}});
  }
  return list;
}

// Tells where an unturned arrangement's frame breaks, and answers.
absl::Status AnswerDressed(Session& session, const DressFlags& flags, const Dressing& dressing,
                           const Arrangement& arrangement) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Break> breaks, FindBreaks(dressing, arrangement));
  const std::vector<StageTime> stages = session.FinishStages();
  const Json list = JsonOfBreaks(dressing, breaks);
  const size_t num_quads = dressing.tile.size();
  session.Answer(
      {{"file", flags.output}, {"num_quads", num_quads}, {"num_breaks", breaks.size()}, {"breaks", list}},
      fmt::format("{}: {} quads, {} breaks", flags.output, num_quads, breaks.size()));
  if (breaks.empty()) {
    return absl::OkStatus();
  }
  session.Warn(fmt::format("{}: the frame of {} breaks at {} edge{}, where tiles do not match{}",
                           flags.output, arrangement.id, breaks.size(), breaks.size() == 1 ? "" : "s",
                           breaks.size() > kBreaksInText ? "; --json lists all, the first are" : ""));
  for (size_t i = 0; i < std::min(breaks.size(), kBreaksInText); ++i) {
    const Quad& quad = dressing.mesh.quads[breaks[i].face];
    session.Note(
        fmt::format("{}, quads {} and {}",
                    EdgeName(dressing.mesh.positions, quad[breaks[i].side], quad[(breaks[i].side + 1) & 3]),
                    breaks[i].face + 1, breaks[i].other_face + 1));
  }
  return absl::OkStatus();
}

absl::Status DressHere(Session& session, const DressFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(flags.arrangement));
  TESSERA_ASSIGN_OR_RETURN(const ReadResult read, ReadMesh(session, flags.mesh, flags.target_quads));
  // What was remeshed has the number of quads it is to have.
  const DressParams params{
      .seed = flags.seed,
      .allow_breaks = flags.allow_breaks,
      .target_quads = read.remeshed ? static_cast<uint32_t>(read.mesh.quads.size()) : flags.target_quads};
  TESSERA_ASSIGN_OR_RETURN(const DressResult result,
                           DressMesh(read.mesh, *arrangement, params, session.Context()));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, SerializeDressing(result.dressing));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, bytes));
  return AnswerDressed(session, flags, result.dressing, *arrangement);
}

absl::Status DressThere(Session& session, const DressFlags& flags) {
  v1::DressMeshRequest request;
  TESSERA_ASSIGN_OR_RETURN(*request.mutable_arrangement(), FullArrangementName(flags.arrangement));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  if (const std::optional<std::string> shape = BuiltinName(flags.mesh)) {
    request.set_builtin(*shape);
  } else {
    TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client->UploadFile(flags.mesh, context));
    request.set_mesh_sha256(blob.sha256());
  }
  request.set_seed(flags.seed);
  request.set_allow_breaks(flags.allow_breaks);
  request.set_target_quads(flags.target_quads);
  TESSERA_ASSIGN_OR_RETURN(const v1::DressMeshResponse response, client->DressMesh(request, context));
  TESSERA_RETURN_IF_ERROR(client->DownloadFile(response.dressing(), flags.output, context));
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(flags.arrangement));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(flags.output));
  TESSERA_ASSIGN_OR_RETURN(const Dressing dressing, ParseDressing(BytesOf(bytes)));
  return AnswerDressed(session, flags, dressing, *arrangement);
}

struct RedressFlags {
  std::string dressing;
  std::string tile_set;
};

absl::Status RunRedress(Session& session, const RedressFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string dressing_bytes, ReadWholeFile(flags.dressing));
  TESSERA_ASSIGN_OR_RETURN(const Dressing dressing, ParseDressing(BytesOf(dressing_bytes)));
  const auto begin = Clock::now();
  TileSet tile_set;
  // A file that was pulled needs no server.
  if (std::filesystem::path(flags.tile_set).extension() == ".tsra") {
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(flags.tile_set));
    TESSERA_ASSIGN_OR_RETURN(tile_set, ParseTileSet(BytesOf(bytes)));
  } else {
    TESSERA_ASSIGN_OR_RETURN(const std::string name, FullTileSetName(flags.tile_set));
    TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
    TESSERA_ASSIGN_OR_RETURN(tile_set, client->FetchTileSet(name, session.Context()));
  }
  const double fetch_ms = MillisecondsSince(begin);
  const auto bind_begin = Clock::now();
  TESSERA_ASSIGN_OR_RETURN(const Binding binding, Redress(dressing, tile_set));
  const double bind_ms = MillisecondsSince(bind_begin);
  session.FinishStages();
  session.Answer({{"dressing", flags.dressing},
                  {"tile_set", flags.tile_set},
                  {"num_quads", binding.texels.size()},
                  {"tile_size", binding.tile_size},
                  {"bind_ms", bind_ms},
                  {"fetch_ms", fetch_ms},
                  {"total_ms", fetch_ms + bind_ms}},
                 fmt::format("{} quads bound to {} in {:.3f} ms ({:.1f} ms with getting the tile set)",
                             binding.texels.size(), flags.tile_set, bind_ms, fetch_ms + bind_ms));
  return absl::OkStatus();
}

absl::Status RunInfo(Session& session, const std::string& path, uint32_t target_quads) {
  TESSERA_ASSIGN_OR_RETURN(const ReadResult read, ReadMesh(session, path, target_quads));
  TESSERA_ASSIGN_OR_RETURN(const MeshInfo info, DescribeMesh(read.mesh));
  session.FinishStages();
  const Json value = {
      {"mesh", path},
      {"remeshed", read.remeshed},
      {"num_vertices", info.num_vertices},
      {"num_quads", info.num_quads},
      {"num_edges", info.num_edges},
      {"num_components", info.num_components},
      {"genus", info.genus},
      {"num_boundary_loops", info.num_boundary_loops},
      {"num_boundary_edges", info.num_boundary_edges},
      {"num_irregular_vertices", info.num_irregular_vertices},
      {"edge_length", {{"min", info.min_edge}, {"median", info.median_edge}, {"max", info.max_edge}}},
      {"quad_area", {{"min", info.min_area}, {"median", info.median_area}, {"max", info.max_area}}},
      {"box_min", {info.box_min.x(), info.box_min.y(), info.box_min.z()}},
      {"box_max", {info.box_max.x(), info.box_max.y(), info.box_max.z()}}};
  session.Answer(value, TextRecord(value));
  return absl::OkStatus();
}

}  // namespace

void AddMeshCommands(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("mesh", "Quad meshes and their dressings");
  noun->require_subcommand(1);

  constexpr char kMeshHelp[] =
      "OBJ or OFF file of quads, a closed mesh of triangles (OBJ, OFF, PLY, GLB, glTF), which is remeshed, "
      "or builtin:plane, torus, cube-sphere, genus3";
  const auto dress_flags = std::make_shared<DressFlags>();
  CLI::App* dress =
      noun->add_subcommand("dress", "Give each quad a tile of an arrangement; done here, once per mesh");
  dress->add_option("MESH", dress_flags->mesh, kMeshHelp)->required();
  dress->add_option("--arrangement", dress_flags->arrangement, "plane-16, plane-81, surface-26, surface-96..")
      ->required();
  dress->add_option("--seed", dress_flags->seed, "Same seed, same dressing")->capture_default_str();
  dress->add_flag("--allow-breaks", dress_flags->allow_breaks,
                  "Accept edges where an unturned arrangement cannot match");
  dress->add_option(
      "--quads", dress_flags->target_quads,
      "Subdivide to about this many quads [built-in rule]; triangles are remeshed to it [4000]");
  dress->add_flag("--on-server", dress_flags->on_server, "Let the server do it");
  dress->add_option("-o,--output", dress_flags->output, "File to write, .tsra")->required();
  dress->callback([&session, dress_flags] {
    session.run = [&session, dress_flags] {
      return dress_flags->on_server ? DressThere(session, *dress_flags) : DressHere(session, *dress_flags);
    };
  });

  const auto redress_flags = std::make_shared<RedressFlags>();
  CLI::App* redress =
      noun->add_subcommand("redress", "Bind a tile set to a dressing and print how long it took");
  redress->add_option("DRESSING", redress_flags->dressing, "File of `mesh dress`")->required();
  redress
      ->add_option("--tileset", redress_flags->tile_set, "ARRANGEMENT/NAME, or a pulled file ending in .tsra")
      ->required();
  redress->callback([&session, redress_flags] {
    session.run = [&session, redress_flags] { return RunRedress(session, *redress_flags); };
  });

  const auto remesh_flags = std::make_shared<RemeshFlags>();
  CLI::App* remesh = noun->add_subcommand(
      "remesh",
      "Turn a closed triangle mesh into quads of similar size; prints how far they are from squares");
  remesh
      ->add_option("MESH", remesh_flags->input,
                   "OBJ, OFF, PLY, GLB or glTF file, at most 4 million triangles")
      ->required();
  remesh->add_option("--quads", remesh_flags->target_quads, "About this many, within 10 %")
      ->capture_default_str();
  remesh->add_option("-o,--output", remesh_flags->output, "File to write, .obj")->required();
  remesh->callback([&session, remesh_flags] {
    session.run = [&session, remesh_flags] { return RunRemesh(session, *remesh_flags); };
  });

  const auto mesh = std::make_shared<std::string>();
  const auto info_quads = std::make_shared<uint32_t>(kDefaultRemeshQuads);
  CLI::App* info = noun->add_subcommand("info", "Check a mesh and count what it is made of");
  info->add_option("MESH", *mesh, kMeshHelp)->required();
  info->add_option("--quads", *info_quads, "Triangles are remeshed to about this many")
      ->capture_default_str();
  info->callback([&session, mesh, info_quads] {
    session.run = [&session, mesh, info_quads] { return RunInfo(session, *mesh, *info_quads); };
  });
}

}  // namespace tessera::cli
