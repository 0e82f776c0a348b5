#include "viewer/script.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "btf/base/status_macros.h"
#include "btf/math/conventions.h"

namespace tessera::viewer {
namespace {

using Json = nlohmann::ordered_json;
using Kind = ScriptStep::Kind;

constexpr std::chrono::minutes kLongestWait{10};
// A wait does not take the processor from what it waits for.
constexpr std::chrono::milliseconds kWaitStep{2};
constexpr int kMostFrames = 100000;

struct StepForm {
  const char* key;
  Kind kind;
  int numbers;  // 0: a text
};
constexpr StepForm kForms[] = {{"wait", Kind::kWait, 0},
                               {"select", Kind::kSelect, 0},
                               {"orbit", Kind::kOrbit, 2},
                               {"pan", Kind::kPan, 2},
                               {"zoom", Kind::kZoom, 1},
                               {"light", Kind::kLight, 2},
                               {"sky", Kind::kSky, 2},
                               {"exposure", Kind::kExposure, 1},
                               {"tone", Kind::kTone, 0},
                               {"frames", Kind::kFrames, 1},
                               {"screenshot", Kind::kScreenshot, 0}};

absl::Status BadLine(size_t line, std::string_view expected) {
  return absl::InvalidArgumentError(
      absl::StrCat("script, line ", line, ": expected ", std::string(expected)));
}

absl::StatusOr<double> FiniteNumber(const Json& value, size_t line, const char* key) {
  if (!value.is_number() || !std::isfinite(value.get<double>())) {
    return BadLine(line, absl::StrCat("numbers after \"", key, "\""));
  }
  return value.get<double>();
}

absl::StatusOr<ScriptStep> ParseStep(const StepForm& form, const Json& value, size_t line) {
  ScriptStep step{.kind = form.kind};
  if (form.numbers == 0) {
    if (!value.is_string()) {
      return BadLine(line, absl::StrCat("a text after \"", form.key, "\""));
    }
    step.text = value.get<std::string>();
    if (form.kind == Kind::kTone && !ParseToneCurve(step.text).ok()) {
      return BadLine(line, "\"none\", \"reinhard\" or \"filmic\" after \"tone\"");
    }
    return form.kind != Kind::kWait || step.text == "loaded" ? absl::StatusOr<ScriptStep>(step)
                                                             : BadLine(line, "\"loaded\" after \"wait\"");
  }
  if (form.numbers == 1) {
    TESSERA_ASSIGN_OR_RETURN(step.first, FiniteNumber(value, line, form.key));
    if (form.kind == Kind::kExposure && !CheckTone({.exposure_stops = step.first}).ok()) {
      return BadLine(line, "-20 to 20 after \"exposure\"");
    }
    return step;
  }
  if (!value.is_array() || value.size() != 2) {
    return BadLine(line, absl::StrCat("[number, number] after \"", form.key, "\""));
  }
  TESSERA_ASSIGN_OR_RETURN(step.first, FiniteNumber(value[0], line, form.key));
  TESSERA_ASSIGN_OR_RETURN(step.second, FiniteNumber(value[1], line, form.key));
  if (form.kind == Kind::kSky && step.second < 0.0) {
    return BadLine(line, "a strength of at least 0 after \"sky\"");
  }
  return step;
}

absl::StatusOr<ScriptStep> ParseLine(std::string_view text, size_t line) {
  const Json object = Json::parse(text.begin(), text.end(), nullptr, /*allow_exceptions=*/false);
  if (!object.is_object() || object.size() != 1) {
    return BadLine(line, "a JSON object of one key");
  }
  const std::string& key = object.begin().key();
  std::string known;
  for (const StepForm& form : kForms) {
    if (key == form.key) {
      return ParseStep(form, object.begin().value(), line);
    }
    absl::StrAppend(&known, known.empty() ? "" : ", ", form.key);
  }
  return BadLine(line, absl::StrCat("one of ", known, ", not \"", key, "\""));
}

absl::Status OneFrame(App& app) {
  TESSERA_ASSIGN_OR_RETURN(const bool is_open, app.Frame());
  return is_open ? absl::OkStatus() : absl::CancelledError("the window was closed");
}

// One frame first, which asks for what has changed, and one last, which shows what has come.
absl::Status WaitUntilSettled(App& app) {
  const auto end = std::chrono::steady_clock::now() + kLongestWait;
  TESSERA_RETURN_IF_ERROR(OneFrame(app));
  while (!app.IsSettled()) {
    if (std::chrono::steady_clock::now() > end) {
      return absl::DeadlineExceededError("script: nothing settled within ten minutes");
    }
    std::this_thread::sleep_for(kWaitStep);
    TESSERA_RETURN_IF_ERROR(OneFrame(app));
  }
  return OneFrame(app);
}

// Once nothing is on its way, none are coming.
const char* MipWord(MipUse mips) {
  return mips == MipUse::kDrawn ? "drawn" : mips == MipUse::kNotNeeded ? "not needed" : "none";
}

std::string ReportLine(const App& app, const std::string& name) {
  const std::optional<Redressing>& done = app.redressing();
  if (!done.has_value() || done->tile_set != name) {
    return Json{{"select", name}, {"shown", false}}.dump() + "\n";
  }
  return Json{{"select", name},
              {"shown", true},
              {"cached", done->was_cached},
              {"pictures", done->pictures},
              {"load_ms", done->load_ms},
              {"prepare_ms", done->prepare_ms},
              {"draw_ms", done->draw_ms},
              {"total_ms", done->total_ms},
              {"texels_per_pixel", app.facts().texels_per_pixel},
              {"mips", MipWord(app.facts().mips)}}
             .dump() +
         "\n";
}

absl::Status RunStep(App& app, const ScriptStep& step, std::string& report) {
  constexpr int kScriptHeight = 480;  // of the window that the script's mouse moves in
  switch (step.kind) {
    case Kind::kWait:
      return WaitUntilSettled(app);
    case Kind::kSelect:
      app.Select(step.text);
      TESSERA_RETURN_IF_ERROR(WaitUntilSettled(app));
      report += ReportLine(app, step.text);
      return absl::OkStatus();
    case Kind::kOrbit:
      app.state().camera.Orbit(step.first, step.second, kScriptHeight);
      return absl::OkStatus();
    case Kind::kPan:
      app.state().camera.Pan(step.first, step.second, kScriptHeight);
      return absl::OkStatus();
    case Kind::kZoom:
      app.state().camera.Zoom(step.first);
      return absl::OkStatus();
    case Kind::kLight:
      app.state().light.Set(RadFromDeg(step.first), RadFromDeg(step.second));
      return absl::OkStatus();
    case Kind::kSky:
      app.state().sky.azimuth_rad = RadFromDeg(step.first);
      app.state().sky.strength = step.second;
      return absl::OkStatus();
    case Kind::kExposure:
      app.state().tone.exposure_stops = step.first;
      return absl::OkStatus();
    case Kind::kTone: {
      TESSERA_ASSIGN_OR_RETURN(app.state().tone.curve, ParseToneCurve(step.text));
      return absl::OkStatus();
    }
    case Kind::kFrames:
      for (int i = 0; i < std::min<double>(step.first, kMostFrames); ++i) {
        TESSERA_RETURN_IF_ERROR(OneFrame(app));
      }
      return absl::OkStatus();
    case Kind::kScreenshot:
      TESSERA_RETURN_IF_ERROR(WaitUntilSettled(app));
      return app.WriteScreenshot(step.text);
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<ScriptStep>> ParseScript(std::string_view text) {
  std::vector<ScriptStep> steps;
  size_t line = 0;
  for (size_t begin = 0; begin < text.size(); ++line) {
    const size_t end = std::min(text.find('\n', begin), text.size());
    const std::string_view content = text.substr(begin, end - begin);
    begin = end + 1;
    if (content.find_first_not_of(" \t\r") != std::string_view::npos) {
      TESSERA_ASSIGN_OR_RETURN(steps.emplace_back(), ParseLine(content, line + 1));
    }
  }
  return steps;
}

absl::Status RunScript(App& app, const std::vector<ScriptStep>& steps, std::string& report) {
  for (const ScriptStep& step : steps) {
    TESSERA_RETURN_IF_ERROR(RunStep(app, step, report));
  }
  return absl::OkStatus();
}

}  // namespace tessera::viewer
