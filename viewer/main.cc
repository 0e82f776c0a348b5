// The program `tessera-viewer`. See README.md.
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

#include <imgui.h>
#include <CLI/CLI.hpp>

#include "btf/base/atomic_file.h"
#include "btf/base/cpu_features.h"
#include "btf/base/status_macros.h"
#include "btf/light/environment.h"
#include "btf/light/frequency_light.h"
#include "client/lib/client.h"
#include "viewer/app.h"
#include "viewer/script.h"

namespace tessera::viewer {
namespace {

struct Flags {
  ViewerOptions viewer;
  std::string size = "1280x800";
  std::string offscreen;  // the picture to write
  std::string script;
  std::string environment;
  int frames = 1;
};

struct WindowSize {
  int width = 0;
  int height = 0;
};

// Both sides 320 to 8192.
absl::StatusOr<WindowSize> ParseWindowSize(const std::string& text) {
  WindowSize size;
  char rest = '\0';
  const bool is_form = std::sscanf(text.c_str(), "%5dx%5d%c", &size.width, &size.height, &rest) == 2;
  const auto fits = [](int side) { return side >= 320 && side <= 8192; };
  if (!is_form || !fits(size.width) || !fits(size.height)) {
    return absl::InvalidArgumentError("--size \"" + text + "\": expected WIDTHxHEIGHT, both 320 to 8192");
  }
  return size;
}

absl::StatusOr<std::vector<ScriptStep>> StepsOf(const Flags& flags) {
  std::vector<ScriptStep> steps;
  if (!flags.script.empty()) {
    TESSERA_ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(flags.script));
    TESSERA_ASSIGN_OR_RETURN(steps, ParseScript(text));
  }
  if (!flags.offscreen.empty()) {
    steps.push_back({.kind = ScriptStep::Kind::kWait});
    steps.push_back({.kind = ScriptStep::Kind::kFrames, .first = static_cast<double>(flags.frames)});
    steps.push_back({.kind = ScriptStep::Kind::kScreenshot, .text = flags.offscreen});
  }
  return steps;
}

// Messages that nobody reads in the window.
void PrintMessages(const ViewerState& state) {
  for (const Notice& message : state.messages()) {
    std::fprintf(stderr, "tessera-viewer: %s%s\n", message.is_error ? "error: " : "", message.text.c_str());
  }
}

absl::StatusOr<std::shared_ptr<const FrequencyLight>> SkyOf(const Flags& flags) {
  constexpr int kSkyHarmonics = 25;
  if (flags.environment.empty()) {
    return nullptr;
  }
  TESSERA_ASSIGN_OR_RETURN(const Environment environment, ReadEnvironment(flags.environment, {}));
  TESSERA_ASSIGN_OR_RETURN(FrequencyLight light, FrequencyLight::Create(environment, kSkyHarmonics));
  return std::make_shared<const FrequencyLight>(std::move(light));
}

absl::Status RunOn(Display& display, const Flags& flags, const std::vector<ScriptStep>& steps) {
  ViewerOptions options = flags.viewer;
  TESSERA_ASSIGN_OR_RETURN(options.sky, SkyOf(flags));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<App> app,
                           App::Create(display, MakeServerSource(options.server), options));
  if (!steps.empty()) {
    std::string report;
    const absl::Status status = RunScript(*app, steps, report);
    std::fputs(report.c_str(), stdout);
    PrintMessages(app->state());
    return status;
  }
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(const bool is_open, app->Frame());
    if (!is_open) {
      return absl::OkStatus();
    }
  }
}

absl::Status RunViewer(const Flags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const WindowSize size, ParseWindowSize(flags.size));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<ScriptStep> steps, StepsOf(flags));
  IMGUI_CHECKVERSION();
  const std::unique_ptr<ImGuiContext, void (*)(ImGuiContext*)> context(
      ImGui::CreateContext(), [](ImGuiContext* owned) { ImGui::DestroyContext(owned); });
  ImGui::GetIO().IniFilename = nullptr;
  ImGui::StyleColorsDark();
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Display> display,
                           flags.offscreen.empty() ? OpenWindow(size.width, size.height, "Tessera")
                                                   : OpenOffscreen(size.width, size.height));
  return RunOn(*display, flags, steps);
}

void AddOptions(CLI::App& parser, Flags& flags) {
  const char* const server = std::getenv("TESSERA_SERVER");
  flags.viewer.server = server != nullptr ? server : std::string(kDefaultServerAddress);
  parser.add_option("--server", flags.viewer.server, "HOST:PORT [TESSERA_SERVER, else 127.0.0.1:7723]");
  SurfaceChoice& choice = flags.viewer.choice;
  choice.mesh = "builtin:torus";
  auto* const dressing = parser.add_option("--dressing", choice.dressing, "File of `tessera mesh dress`");
  parser
      .add_option("--mesh", choice.mesh,
                  "Or an OBJ or OFF file of quads, a closed mesh of triangles, which is remeshed, or "
                  "builtin:plane, torus, cube-sphere, genus3; dressed here")
      ->excludes(dressing)
      ->capture_default_str();
  parser.add_option("--arrangement", choice.arrangement,
                    "Of that mesh [the tile set's, else surface-96]: plane-16, surface-96..");
  parser.add_option("--tileset", flags.viewer.tile_set, "ARRANGEMENT/NAME to begin with [the first]");
  parser.add_option(
      "--env", flags.environment,
      "Light from all around: a Radiance or OpenEXR picture, equirectangular or an angular map, in "
      "25 spherical harmonics");
  parser.add_option("--size", flags.size, "WIDTHxHEIGHT in pixels")->capture_default_str();
  parser.add_option("--offscreen", flags.offscreen,
                    "Write the window to this PNG file, without a screen, and end");
  parser.add_option("--frames", flags.frames, "Of the interface, before that file is written")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  parser.add_option("--script", flags.script,
                    "Do what this file says (viewer/script.h), print times as JSON lines, and end");
}

int Main(int argc, char** argv) {
  CLI::App parser("Shows meshes dressed in the tile sets of a server, and re-dresses them on a click.",
                  "tessera-viewer");
  Flags flags;
  AddOptions(parser, flags);
  try {
    parser.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return parser.exit(error) == 0 ? 0 : 2;
  }
  std::string& arrangement = flags.viewer.choice.arrangement;
  if (arrangement.empty()) {
    const std::string& tile_set = flags.viewer.tile_set;
    arrangement = tile_set.empty() ? "surface-96" : tile_set.substr(0, tile_set.find('/'));
  }
  const absl::Status status = RunViewer(flags);
  if (!status.ok()) {
    std::fprintf(stderr, "tessera-viewer: error: %s\n", std::string(status.message()).c_str());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace tessera::viewer

int main(int argc, char** argv) {
  if (const std::string missing = tessera::MissingCpuFeatures(); !missing.empty()) {
    std::fprintf(stderr, "tessera-viewer: this build needs a CPU with %s\n", missing.c_str());
    return 1;
  }
  return tessera::viewer::Main(argc, argv);
}
