// Table III of [Leung2007], time and size of tile sets: its five rows, ours beside them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"

namespace tessera {

struct TilesRun {
  double seconds = 0.0;           // wall clock, from the embedding to the tiles; no certificate
  double embed_s = 0.0;           // wall clock of the embedding
  double referenced_share = 0.0;  // of the exemplar's texels
  uint64_t btfel_bytes = 0;       // of the codes of the referenced BTFels
  double insides_ratio = 0.0;     // of the certificate
};

struct TilesRow {
  std::string material;  // the paper's
  std::string source;    // ours
  int side = 0;          // texels of the material, square
  int tile_size = 0;
  int k = 0;  // coefficients for lights, and as many for views
  double paper_minutes = 0.0;
  double paper_share = 0.0;
  double paper_megabytes = 0.0;
  TilesRun run;
};

// Synthesises "surface-96" by the default parameters, thresholds not enforced, from generated materials of
// the paper's sizes, encoded by "dsh" with as many coefficients; minutes. Progress in "tile sets". Errors:
// those of GenerateBtf, of Encode and of synthesis; CANCELLED.
[[nodiscard]] absl::StatusOr<std::vector<TilesRow>> RunTilesTable(const RunContext& context);

// One row each row of the table and method, the paper's figures as method "paper".
[[nodiscard]] std::string TilesCsv(const std::vector<TilesRow>& rows);

}  // namespace tessera
