// tessera material import | generate | list | show | pull | decode | mask | delete
#include <filesystem>
#include <memory>

#include <fmt/format.h>
#include <sys/resource.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/choice/encode_model.h"
#include "btf/data/import.h"
#include "btf/image/image_io.h"
#include "btf/tiles/pattern.h"
#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/cli/exit_codes.h"
#include "client/cli/mask.h"
#include "client/cli/pattern.h"
#include "client/lib/flat_decode.h"
#include "client/lib/names.h"
#include "proto/wire/convert.h"
#include "proto/wire/status.h"

namespace tessera::cli {
namespace {

constexpr uint64_t kMiB = uint64_t{1} << 20;

struct CodecFlags {
  std::string codec = "dsh-cls";
  uint32_t kl = 25;
  uint32_t kv = 25;
  uint32_t eigen_textures = 5;
  std::string cls_energy = "hemisphere";
  uint32_t rank = 0;
  double max_error = 0.0;
  uint64_t max_bytes = 0;
  std::string scene_light;
};

void AddCodecFlags(CLI::App* command, CodecFlags& flags) {
  command
      ->add_option("--codec", flags.codec,
                   fmt::format("Codec id: {}; or {}: the smallest model that meets a bound",
                               fmt::join(CodecIds(), ", "), kAutoCodec))
      ->capture_default_str();
  command->add_option("--kl", flags.kl, "dsh*: light coefficients, 1, 4, 9, 16, 25, 36 or 49")
      ->capture_default_str();
  command->add_option("--kv", flags.kv, "dsh*: view coefficients, likewise")->capture_default_str();
  command
      ->add_option("--eigen-textures", flags.eigen_textures,
                   "view-pca: eigen-textures a view, 1 to 255; no more than lights - 1 are kept")
      ->check(CLI::Range(1, 255))
      ->capture_default_str();
  command->add_option("--cls-energy", flags.cls_energy, "dsh-cls: energy bound")
      ->check(CLI::IsMember({"hemisphere", "sphere"}))
      ->capture_default_str();
  // Bounds of which a codec takes one.
  CLI::Option* rank =
      command
          ->add_option("--rank", flags.rank, fmt::format("dfmf: coefficients a texel [{}]", kDefaultDfmfRank))
          ->check(CLI::PositiveNumber);
  CLI::Option* max_error =
      command
          ->add_option("--max-error", flags.max_error,
                       "dfmf, auto: bound on the root mean square error of linear RGB, absolute; dfmf: over "
                       "the samples; auto: on held-out lights and on held-out views")
          ->check(CLI::PositiveNumber);
  CLI::Option* max_bytes =
      command
          ->add_option("--max-bytes", flags.max_bytes,
                       "dfmf, auto: bound on the container, in bytes or with a unit: 400KB, 2MiB")
          ->transform(CLI::AsSizeValue(/*kb_is_1000=*/true))
          ->check(CLI::PositiveNumber);
  rank->excludes(max_error)->excludes(max_bytes);
  max_error->excludes(max_bytes);
  command
      ->add_option("--for", flags.scene_light,
                   "auto: light of the scene; environment: models that project on spherical harmonics first "
                   "[point]")
      ->check(CLI::IsMember({"point", "environment"}));
}

v1::EncodeOptions MessageOf(const CodecFlags& flags) {
  v1::EncodeOptions message;
  message.set_codec(flags.codec);
  message.set_kl(flags.kl);
  message.set_kv(flags.kv);
  message.set_eigen_textures(flags.eigen_textures);
  message.set_cls_energy(flags.cls_energy);
  message.set_rank(flags.rank);
  message.set_max_error(flags.max_error);
  message.set_max_bytes(flags.max_bytes);
  message.set_scene_light(flags.scene_light);
  return message;
}

struct ImportFlags {
  std::string path;
  std::string name;
  std::string layout = "auto";
  std::string transfer;
  CodecFlags codec;
  Provenance provenance;
  uint64_t memory_budget_mib = 512;
  std::string spill_folder;
  bool on_server = false;
  bool replace = false;
};

// Refuses a name that is taken before the work is done, not after.
absl::Status CheckNameIsFree(Client& client, const std::string& name, bool replace,
                             const RunContext& context) {
  if (replace) {
    return absl::OkStatus();
  }
  const absl::Status found = client.GetMaterial(name, context).status();
  if (found.ok()) {
    return WithReason(
        absl::AlreadyExistsError(fmt::format("{} exists; --replace puts another in its place", name)),
        "NAME_TAKEN", name);
  }
  return absl::IsNotFound(found) ? absl::OkStatus() : found;
}

// The answer of every command that made a material.
void AnswerMade(Session& session, const v1::Material& material, std::string_view job_name) {
  const std::vector<StageTime> stages = session.FinishStages();
  const Json described = Describe(material);
  Json value = {{"material", described}, {"stages", Session::JsonOfStages(stages)}};
  if (!job_name.empty()) {
    value["job"] = ShortName(job_name);
  }
  struct rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  constexpr int64_t kBytesPerUnit = 1024;  // ru_maxrss is in KiB on Linux
  value["peak_memory_bytes"] = usage.ru_maxrss * kBytesPerUnit;
  std::string text = fmt::format(
      "{}: {}x{} texels, {} views, {} lights, {} with {} coefficients, {}", ShortName(material.name()),
      material.width(), material.height(), material.num_views(), material.num_lights(), material.codec(),
      material.num_coefficients(), FormatAmount(static_cast<double>(material.blob().size_bytes()), "bytes"));
  double total = 0;
  for (const StageTime& stage : stages) {
    text += fmt::format("\n{:<12} {:8.2f} s", stage.stage, stage.seconds);
    total += stage.seconds;
  }
  text += fmt::format("\n{:<12} {:8.2f} s, at most {} of memory here", "in all", total,
                      FormatAmount(static_cast<double>(usage.ru_maxrss * kBytesPerUnit), "bytes"));
  session.Answer(value, text);
  const auto lines_at = [&](const char* place) {
    std::vector<std::string> lines;
    for (const Json& line : described.value(Json::json_pointer(place), Json::array())) {
      lines.push_back(fmt::format("{}: {}", ShortName(material.name()),
                                  line.is_string() ? line.get<std::string>() : line.dump()));
    }
    return lines;
  };
  for (const std::string& line : lines_at("/metadata/choice/report")) {
    session.Note(line);
  }
  for (const std::string& line : lines_at("/metadata/diagnosis/warnings")) {
    session.Warn(line);
  }
}

// Waits for a job that makes a material and answers with it; Ctrl-C cancels the job.
absl::Status WaitForMaterial(Session& session, Client& client, const v1::Job& job) {
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const v1::Job ended, client.WaitForJob(job.name(), OnStop::kCancelJob, context));
  TESSERA_ASSIGN_OR_RETURN(const v1::Material material, client.GetMaterial(ended.result_name(), context));
  AnswerMade(session, material, job.name());
  return absl::OkStatus();
}

absl::Status ImportHere(Session& session, Client& client, const ImportFlags& flags, const std::string& name) {
  const RunContext context = session.Context();
  ImportOptions options;
  TESSERA_ASSIGN_OR_RETURN(options.layout, ParseImportLayout(flags.layout));
  if (!flags.transfer.empty()) {
    TESSERA_ASSIGN_OR_RETURN(options.transfer, ParseTransfer(flags.transfer));
  }
  options.memory_budget_bytes = flags.memory_budget_mib * kMiB;
  options.spill_folder = flags.spill_folder;
  options.provenance = flags.provenance;
  TESSERA_ASSIGN_OR_RETURN(ModelRequest model, ModelRequestFromMessage(MessageOf(flags.codec)));
  TESSERA_RETURN_IF_ERROR(CheckModelRequest(model));
  model.params.memory_budget_bytes = options.memory_budget_bytes;
  model.params.spill_folder = options.spill_folder;
  TESSERA_RETURN_IF_ERROR(CheckNameIsFree(client, name, flags.replace, context));

  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<BtfSource> source, ImportBtf(flags.path, options, context));
  TESSERA_ASSIGN_OR_RETURN(const Material material, EncodeModel(*source, model, context));
  source.reset();
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
  TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client.UploadContainer(file, context));
  v1::CreateMaterialRequest request;
  request.set_name(name);
  request.set_blob_sha256(blob.sha256());
  request.set_replace(flags.replace);
  TESSERA_ASSIGN_OR_RETURN(const v1::Material created, client.CreateMaterial(request, context));
  AnswerMade(session, created, "");
  return absl::OkStatus();
}

absl::Status ImportThere(Session& session, Client& client, const ImportFlags& flags,
                         const std::string& name) {
  if (std::filesystem::is_directory(flags.path)) {
    return absl::InvalidArgumentError(fmt::format(
        "{} is a folder: --on-server takes one file, a zip archive or a multi-part EXR", flags.path));
  }
  const RunContext context = session.Context();
  TESSERA_RETURN_IF_ERROR(CheckNameIsFree(client, name, flags.replace, context));
  TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client.UploadFile(flags.path, context));
  v1::ImportMaterialRequest request;
  request.set_name(name);
  request.set_archive_sha256(blob.sha256());
  request.set_layout(flags.layout);
  request.set_transfer(flags.transfer);
  *request.mutable_encode() = MessageOf(flags.codec);
  request.mutable_provenance()->set_source(flags.provenance.source);
  request.mutable_provenance()->set_licence(flags.provenance.licence);
  request.mutable_provenance()->set_citation(flags.provenance.citation);
  request.set_replace(flags.replace);
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client.ImportMaterial(request, context));
  return WaitForMaterial(session, client, job);
}

absl::Status RunImport(Session& session, const ImportFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string name, FullMaterialName(flags.name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  return flags.on_server ? ImportThere(session, *client, flags, name)
                         : ImportHere(session, *client, flags, name);
}

struct GenerateFlags {
  std::string kind;
  std::string name;
  uint32_t size = 128;
  std::string lights = "ubo81";
  std::string views = "ubo81";
  uint64_t seed = 1;
  CodecFlags codec;
  std::string height;
  std::string colour;
  std::string roughness;
  double height_scale = 0;
  bool detach = false;
  bool replace = false;
};

absl::Status RunGenerate(Session& session, const GenerateFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string name, FullMaterialName(flags.name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  v1::GenerateMaterialRequest request;
  request.set_name(name);
  request.set_kind(flags.kind);
  request.set_size(flags.size);
  // "81" is the set of 81 directions of the measurements, so that --lights 81 says what it means.
  request.set_lights(flags.lights == "81" ? "ubo81" : flags.lights);
  request.set_views(flags.views == "81" ? "ubo81" : flags.views);
  request.set_seed(flags.seed);
  *request.mutable_encode() = MessageOf(flags.codec);
  request.set_height_scale(flags.height_scale);
  request.set_replace(flags.replace);
  TESSERA_RETURN_IF_ERROR(CheckNameIsFree(*client, name, flags.replace, context));
  const auto upload = [&](const std::string& path, std::string* sha256) -> absl::Status {
    if (path.empty()) {
      return absl::OkStatus();
    }
    TESSERA_ASSIGN_OR_RETURN(const v1::Blob blob, client->UploadFile(path, context));
    *sha256 = blob.sha256();
    return absl::OkStatus();
  };
  TESSERA_RETURN_IF_ERROR(upload(flags.height, request.mutable_height_sha256()));
  TESSERA_RETURN_IF_ERROR(upload(flags.colour, request.mutable_colour_sha256()));
  TESSERA_RETURN_IF_ERROR(upload(flags.roughness, request.mutable_roughness_sha256()));
  TESSERA_ASSIGN_OR_RETURN(const v1::Job job, client->GenerateMaterial(request, context));
  if (flags.detach) {
    session.Answer(Describe(job), ShortName(job.name()));
    return absl::OkStatus();
  }
  return WaitForMaterial(session, *client, job);
}

absl::Status ListMaterials(Session& session) {
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_ASSIGN_OR_RETURN(const std::vector<v1::Material> materials,
                           client->ListMaterials(session.Context()));
  Json all = Json::array();
  std::vector<std::vector<std::string>> rows = {
      {"MATERIAL", "TEXELS", "VIEWS", "LIGHTS", "CODEC", "SIZE", "SOURCE"}};
  for (const v1::Material& material : materials) {
    all.push_back(Describe(material));
    rows.push_back({ShortName(material.name()), fmt::format("{}x{}", material.width(), material.height()),
                    std::to_string(material.num_views()), std::to_string(material.num_lights()),
                    fmt::format("{} {}", material.codec(), material.num_coefficients()),
                    FormatAmount(static_cast<double>(material.blob().size_bytes()), "bytes"),
                    material.provenance().source()});
  }
  session.Answer({{"materials", std::move(all)}}, TextTable(rows));
  return absl::OkStatus();
}

struct ShowFlags {
  std::string name;
  bool pattern = false;
};

absl::Status ShowMaterial(Session& session, const ShowFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullMaterialName(flags.name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const v1::Material material, client->GetMaterial(full_name, context));
  Json described = Describe(material);
  std::string text = TextRecord(described);
  if (flags.pattern) {
    TESSERA_ASSIGN_OR_RETURN(const Material fetched, client->FetchMaterial(full_name, context));
    TESSERA_ASSIGN_OR_RETURN(const MaterialPattern pattern, MeasureMaterialPattern(fetched, context));
    session.FinishStages();
    described["pattern"] = DescribePattern(pattern);
    text += fmt::format("\npattern: {}", PatternText(described["pattern"]));
  }
  session.Answer(described, text);
  return absl::OkStatus();
}

absl::Status RunPull(Session& session, const std::string& name, const std::string& output) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullMaterialName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const v1::Material material, client->GetMaterial(full_name, context));
  TESSERA_RETURN_IF_ERROR(client->DownloadFile(material.blob(), output, context));
  session.FinishStages();
  session.Answer({{"file", output}, {"material", Describe(material)}}, output);
  return absl::OkStatus();
}

struct DecodeFlags {
  std::string name;
  std::string light;
  std::string view;
  std::string output;
};

absl::Status RunDecode(Session& session, const DecodeFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullMaterialName(flags.name));
  TESSERA_ASSIGN_OR_RETURN(const Direction light, ParseDirection(flags.light));
  TESSERA_ASSIGN_OR_RETURN(const Direction view, ParseDirection(flags.view));
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PictureFormatOf(flags.output));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const Material material, client->FetchMaterial(full_name, context));
  TESSERA_ASSIGN_OR_RETURN(const Image picture, DecodeFlat(material, light, view, context));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           format == PictureFormat::kPng ? EncodePng(picture) : EncodeExr(picture));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, bytes));
  session.FinishStages();
  session.Answer({{"file", flags.output}, {"width", picture.width}, {"height", picture.height}},
                 flags.output);
  return absl::OkStatus();
}

absl::Status RunDelete(Session& session, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullMaterialName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  TESSERA_RETURN_IF_ERROR(client->DeleteMaterial(full_name, session.Context()));
  session.Answer({{"deleted", ShortName(full_name)}}, "");
  return absl::OkStatus();
}

void AddImport(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<ImportFlags>();
  CLI::App* command =
      noun.add_subcommand("import", "A measured BTF: encoded here, only the container is sent");
  command->add_option("PATH", flags->path, "Folder, zip archive, manifest (JSON, CSV) or multi-part EXR")
      ->required();
  command->add_option("--name", flags->name, "Name of the material")->required();
  command->add_option("--layout", flags->layout, "How the images are laid out")
      ->check(CLI::IsMember({"auto", "ubo2003", "manifest", "exr"}))
      ->capture_default_str();
  command->add_option("--transfer", flags->transfer,
                      "Transfer curve of the images: srgb, linear or gamma:G [by file type]");
  AddCodecFlags(command, flags->codec);
  command->add_option("--source", flags->provenance.source, "Where the BTF comes from");
  command->add_option("--licence", flags->provenance.licence, "What may be done with it");
  command->add_option("--citation", flags->provenance.citation, "What to cite");
  command
      ->add_option("--memory-budget", flags->memory_budget_mib, "Bound on memory for samples and codes, MiB")
      ->capture_default_str();
  command->add_option("--spill", flags->spill_folder, "Folder for temporary files [the system's]");
  command->add_flag("--on-server", flags->on_server, "Send the archive and let the server import it");
  command->add_flag("--replace", flags->replace, "Take a name that exists");
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunImport(session, *flags); }; });
}

void AddGenerate(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<GenerateFlags>();
  CLI::App* command = noun.add_subcommand("generate", "A BTF ray-traced from a height field, by the server");
  command->add_option("KIND", flags->kind, "reactdiffuse, holes, wrinkles, weave or heightmap")->required();
  command->add_option("--name", flags->name, "Name of the material")->required();
  command->add_option("--size", flags->size, "Texels per side")->capture_default_str();
  command->add_option("--lights", flags->lights, "Directions: 81 or ubo81, curet, NxM (polar x azimuth)")
      ->capture_default_str();
  command->add_option("--views", flags->views, "Likewise")->capture_default_str();
  command->add_option("--seed", flags->seed, "Another seed, another sample of the kind")
      ->capture_default_str();
  AddCodecFlags(command, flags->codec);
  command->add_option("--height", flags->height, "heightmap: image of heights");
  command->add_option("--colour", flags->colour, "heightmap: image of diffuse colour");
  command->add_option("--roughness", flags->roughness, "heightmap: image of roughness");
  command->add_option("--height-scale", flags->height_scale, "Texels per unit of height [the kind's own]");
  command->add_flag("--detach", flags->detach, "Print the job and return at once");
  command->add_flag("--replace", flags->replace, "Take a name that exists");
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunGenerate(session, *flags); }; });
}

void AddDecode(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<DecodeFlags>();
  CLI::App* command =
      noun.add_subcommand("decode", "One picture of a material under one light from one view");
  command->add_option("MATERIAL", flags->name, "Name of the material")->required();
  command->add_option("--light", flags->light, "TH,PH in degrees, TH from the normal")->required();
  command->add_option("--view", flags->view, "Likewise")->required();
  command->add_option("-o,--output", flags->output, "File to write, .png (sRGB) or .exr (linear)")
      ->required();
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunDecode(session, *flags); }; });
}

}  // namespace

void AddMaterialCommands(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("material", "Compressed BTFs");
  noun->require_subcommand(1);
  AddImport(*noun, session);
  AddGenerate(*noun, session);

  const auto name = std::make_shared<std::string>();
  const auto output = std::make_shared<std::string>();
  CLI::App* list = noun->add_subcommand("list", "Every material");
  list->callback([&session] { session.run = [&session] { return ListMaterials(session); }; });

  CLI::App* show = noun->add_subcommand("show", "One material, its source and its licence");
  const auto show_flags = std::make_shared<ShowFlags>();
  show->add_option("MATERIAL", show_flags->name, "Name of the material")->required();
  show->add_flag("--pattern", show_flags->pattern,
                 "Fetch it and measure, as synthesis does: anisotropy, feature size, period");
  show->callback([&session, show_flags] {
    session.run = [&session, show_flags] { return ShowMaterial(session, *show_flags); };
  });

  CLI::App* pull = noun->add_subcommand("pull", "Download a material's container");
  pull->add_option("MATERIAL", *name, "Name of the material")->required();
  pull->add_option("-o,--output", *output, "File to write, .tsra")->required();
  pull->callback([&session, name, output] {
    session.run = [&session, name, output] { return RunPull(session, *name, *output); };
  });

  AddDecode(*noun, session);
  AddMaskCommand(*noun, session);

  CLI::App* remove = noun->add_subcommand("delete", "Free the name; tile sets made from it stay");
  remove->add_option("MATERIAL", *name, "Name of the material")->required();
  remove->callback(
      [&session, name] { session.run = [&session, name] { return RunDelete(session, *name); }; });
}

}  // namespace tessera::cli
