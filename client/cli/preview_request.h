// What `tessera preview` asks the server for.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "client/cli/arguments.h"
#include "tessera/v1/tessera.pb.h"

namespace tessera::cli {

struct PreviewFlags {
  std::vector<std::string> tile_sets;
  std::vector<std::string> dressings;
  std::vector<std::string> meshes;
  uint64_t seed = 1;
  std::vector<std::string> lights;
  std::string environment;  // a file; empty: none
  double environment_rotation_deg = 0.0;
  double environment_scale = 0.0;  // 0: the server's
  int environment_lights = 0;      // 0: the server's choice, or environment_order
  int environment_order = 0;
  bool shadows = false;
  uint32_t shadow_map = 0;  // 0: the server's
  std::string eye;          // with target, up, or all empty
  std::string target;
  std::string up;
  std::string orbit;
  double fov_deg = 0.0;  // 0: the server's
  double exposure_stops = 0.0;
  std::string tone = "none";
  double white = 0.0;  // 0: the server's
  std::string background = "transparent";
  std::string size = "640x480";
  std::string mips = "auto";
  bool sheet = false;
  int columns = 0;
  int turntable = 0;  // frames; 0: none
  bool animated = false;
  int frames_per_second = 25;
  std::string output;
};

// Flags that exclude each other. Errors: UsageError.
[[nodiscard]] absl::Status CheckPreviewFlags(const PreviewFlags& flags);

// PNG or EXR by the output's name; `.apng` where the picture is animated. Errors: UsageError.
[[nodiscard]] absl::StatusOr<PictureFormat> PreviewFormat(const PreviewFlags& flags);

// Everything but tile set, surface and the environment's blob. Errors: UsageError naming the flag.
[[nodiscard]] absl::StatusOr<v1::RenderPreviewRequest> PreviewRequest(const PreviewFlags& flags);

// Frame `frame` of a turntable: `base`, its eye and lights turned by frame / frames of a circle.
[[nodiscard]] v1::RenderPreviewRequest TurntableRequest(const v1::RenderPreviewRequest& base, int frame,
                                                        int frames);

}  // namespace tessera::cli
