// Where the viewer's meshes and tile sets come from. Behind an interface, so that the loader is tested
// without a server.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/wang/dressing.h"
#include "btf/wang/tile_set.h"
#include "viewer/pixels.h"

namespace tessera::viewer {

// What to show the tile sets on: a file of `tessera mesh dress`, or a mesh to dress now.
struct SurfaceChoice {
  std::string dressing;     // a file, or empty
  std::string mesh;         // a file, or builtin:NAME
  std::string arrangement;  // of the mesh
};

struct Surface {
  std::shared_ptr<const Dressing> dressing;
  std::string note;  // what dressing it changed or could not match; may be empty
};

// One line of the server's list.
struct TileSetEntry {
  std::string name;    // "surface-96/wool"
  std::string sha256;  // of its bytes
  uint64_t size_bytes = 0;
  std::string codec;
  uint32_t tile_size = 0;  // texels
  uint32_t num_tiles = 0;
  uint32_t num_btfels = 0;
  std::string origin;  // source, licence and citation, for people
  // Of its certificate, 1: as the material's own steps.
  std::optional<double> seam_ratio_borders;
  std::optional<double> seam_ratio_insides;
  // Root mean square error of the material that it was made from, absolute, linear RGB; none when that is no
  // longer on the server.
  std::optional<double> codec_error;
  std::vector<std::string> warnings;  // of its synthesis
  std::string thumbnail_sha256;       // empty: the server has none yet
  uint64_t thumbnail_bytes = 0;
};

// Used by one thread at a time.
class Source {
 public:
  virtual ~Source() = default;
  // Errors: those of reading, dressing and remeshing.
  [[nodiscard]] virtual absl::StatusOr<Surface> Open(const SurfaceChoice& choice,
                                                     const RunContext& context) = 0;
  // The tile sets of an arrangement, by name. Errors: UNAVAILABLE without a server, NOT_FOUND.
  [[nodiscard]] virtual absl::StatusOr<std::vector<TileSetEntry>> List(const std::string& arrangement,
                                                                       const RunContext& context) = 0;
  // `name` as in TileSetEntry. Errors: those of Client::FetchTileSet.
  [[nodiscard]] virtual absl::StatusOr<std::shared_ptr<const TileSet>> Fetch(const std::string& name,
                                                                             const RunContext& context) = 0;
  // The picture that the server made of it. Errors: those of Client::FetchBlob and of decoding;
  // INVALID_ARGUMENT where a side is longer than kMostThumbnailSide.
  [[nodiscard]] virtual absl::StatusOr<Pixels> FetchThumbnail(const TileSetEntry& entry,
                                                              const RunContext& context) = 0;
};
inline constexpr int kMostThumbnailSide = 1024;  // pixels

// The server at HOST:PORT, which is connected to when first asked, and again after it went away.
[[nodiscard]] std::unique_ptr<Source> MakeServerSource(std::string address);

}  // namespace tessera::viewer
