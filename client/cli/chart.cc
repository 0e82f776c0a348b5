// tessera chart codecs | synthesis | lighting
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/chart/codec_chart.h"
#include "btf/chart/lighting_chart.h"
#include "btf/chart/synthesis_chart.h"
#include "btf/data/half_btf.h"
#include "btf/data/import.h"
#include "btf/image/image_io.h"
#include "btf/light/generated_environment.h"
#include "btf/meso/generated_source.h"
#include "btf/render/offscreen_context.h"
#include "client/cli/commands.h"
#include "client/cli/describe.h"
#include "client/cli/exit_codes.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

struct ChartFlags {
  std::vector<std::string> sources;
  std::string folder;
  std::string layout = "auto";
  std::string transfer;
  bool quick = false;
  bool paper = false;
  bool paper_largest = false;
  std::vector<std::string> environments;  // of lighting
};

// A generated source is traced once; the chart reads it dozens of times.
absl::StatusOr<std::unique_ptr<BtfSource>> Generated(const GenerateParams& params,
                                                     const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> traced, GenerateBtf(params, context));
  return HalfBtf::CopyOf(*traced, kChartSourceBytes, context);
}

absl::StatusOr<std::unique_ptr<BtfSource>> Imported(const std::string& path, const ChartFlags& flags,
                                                    const RunContext& context) {
  ImportOptions options;
  TESSERA_ASSIGN_OR_RETURN(options.layout, ParseImportLayout(flags.layout));
  if (!flags.transfer.empty()) {
    TESSERA_ASSIGN_OR_RETURN(options.transfer, ParseTransfer(flags.transfer));
  }
  // A quarter of it is kept in memory: all that a chart takes.
  options.memory_budget_bytes = 4 * kChartSourceBytes;
  return ImportBtf(path, options, context);
}

// What the catalog's record of a material names, while it is there.
absl::StatusOr<std::unique_ptr<BtfSource>> SourceOfMaterial(Session& session, const std::string& name,
                                                            const ChartFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullMaterialName(name));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(const Material material, client->FetchMaterial(full_name, context));
  const std::string& source = material.provenance.source;
  if (source.starts_with(kGeneratedPrefix)) {
    TESSERA_ASSIGN_OR_RETURN(GenerateParams params, ParseGeneratedSource(source));
    if (params.kind == "heightmap") {
      return absl::FailedPreconditionError(
          fmt::format("{} was made from images that its record does not hold: give "
                      "generated:heightmap,height=FILE,colour=FILE",
                      full_name));
    }
    params.views = material.btfels.views;
    params.lights = material.btfels.lights;
    return Generated(params, context);
  }
  if (!source.empty() && std::filesystem::exists(source)) {
    return Imported(source, flags, context);
  }
  return absl::FailedPreconditionError(fmt::format(
      "{}: its source is recorded as \"{}\", which is not at hand here: give the folder or file it was "
      "imported from",
      full_name, source));
}

absl::StatusOr<std::unique_ptr<BtfSource>> OpenSource(Session& session, const std::string& text,
                                                      const ChartFlags& flags) {
  if (text.starts_with(kGeneratedPrefix)) {
    TESSERA_ASSIGN_OR_RETURN(const GenerateParams params, ParseGeneratedSource(text));
    return Generated(params, session.Context());
  }
  if (std::filesystem::exists(text)) {
    return Imported(text, flags, session.Context());
  }
  if (text.find_first_of("/.") != std::string::npos) {
    return absl::NotFoundError(fmt::format("{}: no such folder or file", text));
  }
  return SourceOfMaterial(session, text, flags);
}

// The last part of a path where that tells it from the others.
std::string NameOf(const std::string& text, const std::vector<std::string>& all) {
  const auto last = [](const std::string& t) {
    return t.starts_with(kGeneratedPrefix) ? t : std::filesystem::path(t).filename().string();
  };
  const auto same =
      std::ranges::count_if(all, [&](const std::string& other) { return last(other) == last(text); });
  return same == 1 && !last(text).empty() ? last(text) : text;
}

std::string Rmse(const std::optional<SplitFigures>& figures) {
  return figures ? fmt::format("{:.4f}", figures->back().squares.rmse()) : "";
}

std::string SummaryOf(const SourceChart& chart) {
  std::vector<std::vector<std::string>> table = {{"METHOD", "SETTING", "MB", "ENCODE s", "STREAM ns", "GL ms",
                                                  "RMSE", "LIGHTS", "VIEWS", "DSSIM", "FLIP"}};
  for (const ChartPoint& point : chart.points) {
    if (!point.splits[0]) {
      table.push_back({point.method, point.setting, "refused", "", "", "", "", "", "", "", point.refusal});
      continue;
    }
    const LimitFigures& all = point.splits[0]->back();
    table.push_back(
        {point.method, point.setting, fmt::format("{:.3f}", 1e-6 * static_cast<double>(point.size_bytes)),
         fmt::format("{:.2f}", point.encode_s), fmt::format("{:.1f}", 1e9 * point.cpu.streaming_s),
         point.gl ? fmt::format("{:.0f}", 1e3 * point.gl->bilinear_s) : "", Rmse(point.splits[0]),
         Rmse(point.splits[1]), Rmse(point.splits[2]), fmt::format("{:.4f}", all.dssim),
         fmt::format("{:.4f}", all.flip)});
  }
  return fmt::format("{}\n{}", chart.name, TextTable(table));
}

std::string SummaryOf(const std::vector<PaperRow>& rows) {
  std::vector<std::vector<std::string>> table = {
      {"TEXELS", "KV", "KL", "METHOD", "SECONDS", "FASTER", "RATE %", "RELATIVE RMSE"}};
  for (const PaperRow& row : rows) {
    const std::vector<std::string> start = {fmt::format("{0}x{0}", row.side), fmt::format("{}", row.kv),
                                            fmt::format("{}", row.kl)};
    const auto add = [&](std::vector<std::string> rest) {
      rest.insert(rest.begin(), start.begin(), start.end());
      table.push_back(std::move(rest));
    };
    add({"paper", fmt::format("{:.0f}", row.paper_s), "", fmt::format("{:.2f}", 100.0 * row.paper_rate), ""});
    for (const PaperRun& run : row.runs) {
      add({run.method, fmt::format("{:.2f}", run.encode_s), fmt::format("{:.0f}", row.paper_s / run.encode_s),
           fmt::format("{:.2f}",
                       100.0 * static_cast<double>(run.size_bytes) / static_cast<double>(row.RawBytes())),
           fmt::format("{:.4f}", run.relative_rmse)});
    }
    if (row.runs.empty()) {
      add({"ours", "not run: --paper-largest", "", "", ""});
    }
  }
  return TextTable(table);
}

// What all charts do before they measure: the sources are told apart, the folder exists.
absl::Status Prepare(const ChartFlags& flags, const char* command) {
  if (flags.sources.empty() && !flags.paper && !flags.paper_largest) {
    return UsageError(fmt::format("{}: nothing to chart: no SOURCE", command));
  }
  const std::set<std::string> different(flags.sources.begin(), flags.sources.end());
  if (different.size() != flags.sources.size()) {
    return UsageError(fmt::format("{}: a SOURCE is given twice", command));
  }
  std::error_code error;
  std::filesystem::create_directories(flags.folder, error);
  if (error) {
    return absl::InvalidArgumentError(fmt::format("{}: {}", flags.folder, error.message()));
  }
  return absl::OkStatus();
}

std::string PathIn(const ChartFlags& flags, const std::string& file) {
  return (std::filesystem::path(flags.folder) / file).string();
}

PaperSize PaperSizeOf(const ChartFlags& flags) {
  return flags.paper_largest ? PaperSize::kAll : PaperSize::kWithoutLargest;
}

absl::Status RunCodecs(Session& session, const ChartFlags& flags) {
  const bool has_paper = flags.paper || flags.paper_largest;
  TESSERA_RETURN_IF_ERROR(Prepare(flags, "chart codecs"));
  const std::string csv_path = PathIn(flags, "codecs.csv");
  const std::string html_path = PathIn(flags, "codecs.html");
  const std::string paper_path = PathIn(flags, "paper.csv");
  // A folder that takes no file shows now, not in ten minutes.
  TESSERA_RETURN_IF_ERROR(AtomicFile::Create(html_path).status());

  std::vector<SourceChart> charts;
  std::vector<std::string> summaries;
  std::unique_ptr<OffscreenContext> gl;
  if (!flags.sources.empty()) {
    TESSERA_ASSIGN_OR_RETURN(gl, CreateOsmesaContext());
  }
  for (const std::string& text : flags.sources) {
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> source, OpenSource(session, text, flags));
    TESSERA_ASSIGN_OR_RETURN(
        SourceChart chart,
        ChartCodecs(NameOf(text, flags.sources), *source, flags.quick ? ChartSize::kQuick : ChartSize::kFull,
                    *gl, session.Context()));
    summaries.push_back(SummaryOf(chart));
    charts.push_back(std::move(chart));
  }
  std::vector<PaperRow> paper;
  if (has_paper) {
    TESSERA_ASSIGN_OR_RETURN(paper, RunPaperTable(PaperSizeOf(flags), session.Context()));
    summaries.push_back(SummaryOf(paper));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string html, CodecsHtml(charts, paper));
  std::vector<std::string> files = {html_path};
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(html_path, html));
  if (!charts.empty()) {
    TESSERA_RETURN_IF_ERROR(WriteFileAtomically(csv_path, CodecsCsv(charts)));
    files.push_back(csv_path);
  }
  if (has_paper) {
    TESSERA_RETURN_IF_ERROR(WriteFileAtomically(paper_path, PaperCsv(paper)));
    files.push_back(paper_path);
  }
  const std::vector<StageTime> stages = session.FinishStages();
  Json described = Json::array();
  for (const SourceChart& chart : charts) {
    described.push_back({{"name", chart.name}, {"settings", chart.points.size()}});
  }
  session.Answer({{"sources", described}, {"files", files}, {"stages", Session::JsonOfStages(stages)}},
                 fmt::format("{}\n{}", fmt::join(summaries, "\n\n"), fmt::join(files, "\n")));
  return absl::OkStatus();
}

std::string SummaryOf(const SynthesisChart& chart) {
  std::vector<std::vector<std::string>> table = {{"METHOD", "DIMS", "CANDIDATES", "STRIP", "SEED", "SECONDS",
                                                  "R BORDERS", "R WITHIN", "CUT %", "R SEEN", "SEEN", "FULL",
                                                  "REPETITION"}};
  for (const SynthesisPoint& point : chart.points) {
    const SynthesisSetting& setting = point.setting;
    table.push_back({point.charted().name, fmt::format("{}", setting.dims),
                     fmt::format("{}", setting.candidates), fmt::format("{}", setting.strip_height),
                     fmt::format("{}", setting.seed), fmt::format("{:.2f}", point.seconds),
                     fmt::format("{:.3f}", point.borders_ratio), fmt::format("{:.3f}", point.insides_ratio),
                     fmt::format("{:.2f}", 100.0 * point.insides_cut_share),
                     fmt::format("{:.3f}", point.seen_ratio), fmt::format("{:.3f}", point.seen_error),
                     fmt::format("{:.3f}", point.full_error), fmt::format("{:.2f}", point.repetition)});
  }
  return fmt::format("{}\n{}", chart.name, TextTable(table));
}

std::string SummaryOf(const std::vector<TilesRow>& rows) {
  std::vector<std::vector<std::string>> table = {
      {"MATERIAL", "TEXELS", "TILES", "METHOD", "SECONDS", "USED %", "MB", "R WITHIN"}};
  for (const TilesRow& row : rows) {
    const auto add = [&](std::vector<std::string> rest) {
      const std::vector<std::string> start = {row.material, fmt::format("{0}x{0}", row.side),
                                              fmt::format("{0}x{0}", row.tile_size)};
      rest.insert(rest.begin(), start.begin(), start.end());
      table.push_back(std::move(rest));
    };
    add({"paper", fmt::format("{:.0f}", 60.0 * row.paper_minutes),
         fmt::format("{:.2f}", 100.0 * row.paper_share), fmt::format("{:.2f}", row.paper_megabytes), ""});
    add({"frame", fmt::format("{:.1f}", row.run.seconds),
         fmt::format("{:.2f}", 100.0 * row.run.referenced_share),
         fmt::format("{:.2f}", 1e-6 * static_cast<double>(row.run.btfel_bytes)),
         fmt::format("{:.3f}", row.run.insides_ratio)});
  }
  return TextTable(table);
}

// A source's name as part of a file's.
std::string FileNameOf(std::string name) {
  std::ranges::replace_if(
      name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-'; }, '_');
  return name;
}

absl::Status RunSynthesis(Session& session, const ChartFlags& flags) {
  TESSERA_RETURN_IF_ERROR(Prepare(flags, "chart synthesis"));
  const std::string html_path = PathIn(flags, "synthesis.html");
  TESSERA_RETURN_IF_ERROR(AtomicFile::Create(html_path).status());

  std::vector<SynthesisChart> charts;
  std::vector<std::string> summaries;
  for (const std::string& text : flags.sources) {
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> source, OpenSource(session, text, flags));
    TESSERA_ASSIGN_OR_RETURN(
        SynthesisChart chart,
        ChartSynthesis(NameOf(text, flags.sources), *source,
                       flags.quick ? ChartSize::kQuick : ChartSize::kFull, session.Context()));
    summaries.push_back(SummaryOf(chart));
    charts.push_back(std::move(chart));
  }
  std::vector<TilesRow> paper;
  if (flags.paper) {
    TESSERA_ASSIGN_OR_RETURN(paper, RunTilesTable(session.Context()));
    summaries.push_back(SummaryOf(paper));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string html, SynthesisHtml(charts, paper));
  std::vector<std::string> files;
  const auto write = [&](const std::string& path, const std::string& bytes) {
    files.push_back(path);
    return WriteFileAtomically(path, bytes);
  };
  TESSERA_RETURN_IF_ERROR(write(html_path, html));
  if (!charts.empty()) {
    TESSERA_RETURN_IF_ERROR(write(PathIn(flags, "synthesis.csv"), SynthesisCsv(charts)));
  }
  for (const SynthesisChart& chart : charts) {
    for (size_t method = 0; method < chart.sheets.size(); ++method) {
      TESSERA_ASSIGN_OR_RETURN(const std::string png, EncodePng(chart.sheets[method]));
      const std::string file = FileNameOf(fmt::format("{}-{}", chart.name, kChartedMethods[method].name));
      TESSERA_RETURN_IF_ERROR(write(PathIn(flags, file + ".png"), png));
    }
  }
  if (flags.paper) {
    TESSERA_RETURN_IF_ERROR(write(PathIn(flags, "tiles.csv"), TilesCsv(paper)));
  }
  const std::vector<StageTime> stages = session.FinishStages();
  Json described = Json::array();
  for (const SynthesisChart& chart : charts) {
    described.push_back({{"name", chart.name}, {"settings", chart.points.size()}});
  }
  session.Answer({{"sources", described}, {"files", files}, {"stages", Session::JsonOfStages(stages)}},
                 fmt::format("{}\n{}", fmt::join(summaries, "\n\n"), fmt::join(files, "\n")));
  return absl::OkStatus();
}

std::string SummaryOf(const LightingChart& chart) {
  std::vector<std::vector<std::string>> table = {
      {"ENVIRONMENT", "METHOD", "COUNT", "MS", "BY ONE LIGHT", "ERROR %", "WITH SHADOWS %"}};
  for (const LightingEnvironment& environment : chart.environments) {
    for (const LightingPoint& point : environment.points) {
      table.push_back({environment.name, kLightingMethodNames[static_cast<size_t>(point.method)],
                       fmt::format("{}", point.count), fmt::format("{:.1f}", 1e3 * point.seconds),
                       fmt::format("{:.1f}", point.seconds / chart.one_light_s),
                       fmt::format("{:.3f}", 100.0 * point.error),
                       fmt::format("{:.3f}", 100.0 * point.shadowed_error)});
    }
  }
  return fmt::format("{}\n{}", chart.name, TextTable(table));
}

absl::StatusOr<std::vector<NamedEnvironment>> EnvironmentsOf(const ChartFlags& flags) {
  std::vector<std::string> names = flags.environments;
  if (names.empty()) {
    for (const std::string& name : GeneratedEnvironmentNames()) {
      names.push_back(fmt::format("{}{}", kGeneratedPrefix, name));
    }
  }
  std::vector<NamedEnvironment> environments;
  for (const std::string& name : names) {
    absl::StatusOr<Environment> environment =
        name.starts_with(kGeneratedPrefix)
            ? GeneratedEnvironment(std::string_view(name).substr(std::string_view(kGeneratedPrefix).size()))
            : ReadEnvironment(name, {});
    TESSERA_RETURN_IF_ERROR(environment.status());
    environments.push_back({NameOf(name, names), *std::move(environment)});
  }
  return environments;
}

absl::Status RunLighting(Session& session, const ChartFlags& flags) {
  TESSERA_RETURN_IF_ERROR(Prepare(flags, "chart lighting"));
  const std::string html_path = PathIn(flags, "lighting.html");
  const std::string csv_path = PathIn(flags, "lighting.csv");
  TESSERA_RETURN_IF_ERROR(AtomicFile::Create(html_path).status());
  TESSERA_ASSIGN_OR_RETURN(const std::vector<NamedEnvironment> environments, EnvironmentsOf(flags));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<OffscreenContext> gl, CreateOsmesaContext());
  std::vector<LightingChart> charts;
  std::vector<std::string> summaries;
  for (const std::string& text : flags.sources) {
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<BtfSource> source, OpenSource(session, text, flags));
    TESSERA_ASSIGN_OR_RETURN(
        LightingChart chart,
        ChartLighting(NameOf(text, flags.sources), *source, environments,
                      flags.quick ? ChartSize::kQuick : ChartSize::kFull, *gl, session.Context()));
    summaries.push_back(SummaryOf(chart));
    charts.push_back(std::move(chart));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::string html, LightingHtml(charts));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(html_path, html));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(csv_path, LightingCsv(charts)));
  const std::vector<StageTime> stages = session.FinishStages();
  Json described = Json::array();
  for (const LightingChart& chart : charts) {
    described.push_back({{"name", chart.name}, {"environments", chart.environments.size()}});
  }
  const std::vector<std::string> files = {html_path, csv_path};
  session.Answer({{"sources", described}, {"files", files}, {"stages", Session::JsonOfStages(stages)}},
                 fmt::format("{}\n{}", fmt::join(summaries, "\n\n"), fmt::join(files, "\n")));
  return absl::OkStatus();
}

// The options that all charts have.
std::shared_ptr<ChartFlags> AddChart(CLI::App& command, const char* files, const char* quick) {
  auto flags = std::make_shared<ChartFlags>();
  command.add_option(
      "SOURCE", flags->sources,
      "Folder or file as for material import, generated:KIND[,key=value..] (size, seed, views, lights, "
      "..), or a material whose recorded source is at hand");
  command.add_option("-o,--output", flags->folder, files)->required();
  command.add_flag("--quick", flags->quick, quick);
  command.add_option("--layout", flags->layout, "How the images of folders and files are laid out")
      ->check(CLI::IsMember({"auto", "ubo2003", "manifest", "exr"}))
      ->capture_default_str();
  command.add_option("--transfer", flags->transfer,
                     "Their transfer curve: srgb, linear or gamma:G [by file type]");
  return flags;
}

}  // namespace

void AddChartCommand(CLI::App& app, Session& session) {
  CLI::App* noun = app.add_subcommand("chart", "Methods against each other, as CSV and as a page");
  noun->require_subcommand(1);
  CLI::App* codecs = noun->add_subcommand(
      "codecs", "Bytes, time and error of every codec and setting, and of JPEG files; minutes a source");
  const auto codec_flags = AddChart(*codecs, "Folder for codecs.html, codecs.csv, paper.csv",
                                    "Few settings, on the middle 64x64 texels: under a minute");
  codecs->add_flag("--paper", codec_flags->paper,
                   "Table II of Leung et al. 2007, ours beside it, up to 256x256 texels");
  codecs->add_flag("--paper-largest", codec_flags->paper_largest,
                   "The same with its 800x800 rows: minutes more");
  codecs->callback([&session, codec_flags] {
    session.run = [&session, codec_flags] { return RunCodecs(session, *codec_flags); };
  });
  CLI::App* synthesis = noun->add_subcommand(
      "synthesis", "Seams, time and repetition of tiles, ours and the published baselines; minutes a source");
  const auto synthesis_flags =
      AddChart(*synthesis, "Folder for synthesis.html, synthesis.csv, tiles.csv and pictures of the tiles",
               "Few settings, on the middle 64x64 texels: under a minute");
  synthesis->add_flag("--paper", synthesis_flags->paper,
                      "Table III of Leung et al. 2007, ours beside it: many minutes more");
  synthesis->callback([&session, synthesis_flags] {
    session.run = [&session, synthesis_flags] { return RunSynthesis(session, *synthesis_flags); };
  });
  CLI::App* lighting = noun->add_subcommand("lighting",
                                            "Light from all around: lights by importance against the "
                                            "frequency domain, error against time; minutes a "
                                            "source");
  const auto lighting_flags = AddChart(*lighting, "Folder for lighting.html, lighting.csv",
                                       "Small pictures, few points: under a minute");
  lighting
      ->add_option(
          "--env", lighting_flags->environments,
          "Radiance or OpenEXR picture, or generated:sky, studio, sun; repeat for more [those three]")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  lighting->callback([&session, lighting_flags] {
    session.run = [&session, lighting_flags] { return RunLighting(session, *lighting_flags); };
  });
}

}  // namespace tessera::cli
