// What the viewer does by itself, for tests, pictures and measurements: JSON, one object a line.
//
//   {"wait": "loaded"}                      until nothing is on its way and the picture is drawn
//   {"select": "surface-96/wool"}           a click on the tile set; then waits, as above, and reports times
//   {"orbit": [30, -10]}  {"pan": [5, 0]}   by pixels of a mouse
//   {"zoom": 3}                             by steps of its wheel
//   {"light": [120, 40]}                    azimuth, elevation, degrees
//   {"sky": [90, 1.5]}                      the environment's turn, degrees, and its strength
//   {"exposure": -1.5}                      stops, -20 to 20
//   {"tone": "filmic"}                      none, reinhard, filmic
//   {"frames": 10}                          so many frames of the interface
//   {"screenshot": "f.png"}                 the window, once the picture is drawn
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "viewer/app.h"

namespace tessera::viewer {

struct ScriptStep {
  enum class Kind {
    kWait,
    kSelect,
    kOrbit,
    kPan,
    kZoom,
    kLight,
    kSky,
    kExposure,
    kTone,
    kFrames,
    kScreenshot
  };
  Kind kind = Kind::kWait;
  std::string text;    // of kSelect, kTone and kScreenshot
  double first = 0.0;  // numbers, in order
  double second = 0.0;
};

// Empty lines are passed over. Errors: INVALID_ARGUMENT naming the line and what was expected.
[[nodiscard]] absl::StatusOr<std::vector<ScriptStep>> ParseScript(std::string_view text);

// Does them in order; what a `select` took is appended to `report` as a line of JSON. Errors: those of
// screenshots and GL, DEADLINE_EXCEEDED when a wait takes longer than ten minutes, CANCELLED when the window
// is closed.
[[nodiscard]] absl::Status RunScript(App& app, const std::vector<ScriptStep>& steps, std::string& report);

}  // namespace tessera::viewer
