// Table II of [Leung2007], time and size of the compression: its six rows, ours beside them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"

namespace tessera {

struct PaperRun {
  std::string method;
  double encode_s = 0.0;       // wall clock, without reading the source
  double encode_cpu_s = 0.0;   // of all threads, likewise
  uint64_t size_bytes = 0;     // of the whole container
  double relative_rmse = 0.0;  // at the sampled directions, of every (side / kPaperMeasuredRows)-th row
};
inline constexpr int kPaperMeasuredRows = 8;

struct PaperRow {
  int side = 0;  // texels, square
  int kv = 0;
  int kl = 0;
  double paper_s = 0.0;        // on its Pentium IV 3.2 GHz
  double paper_rate = 0.0;     // compressed over raw
  std::vector<PaperRun> runs;  // none where the row was not run

  // 8-bit RGB under 81 lights and 81 views.
  [[nodiscard]] uint64_t RawBytes() const { return uint64_t{3} * side * side * 81 * 81; }
};

enum class PaperSize {
  kWithoutLargest,  // 128 x 128 and 256 x 256
  kAll              // 800 x 800, too
};

// Runs the paper's codec, "dsh-cls", and ours, "dsh" with as many coefficients and "dfmf" as it comes, on
// BTFs of the rows' sizes: "generated:reactdiffuse" of 128 x 128 texels, whose field has no end, repeated.
// All rows are streamed within the default memory budget. Half a minute on two cores for kWithoutLargest,
// minutes for kAll. Progress in "encodings". Errors: those of GenerateBtf and of Encode; CANCELLED.
[[nodiscard]] absl::StatusOr<std::vector<PaperRow>> RunPaperTable(PaperSize size, const RunContext& context);

// One row each row of the table and method, the paper's figures as method "paper".
[[nodiscard]] std::string PaperCsv(const std::vector<PaperRow>& rows);

}  // namespace tessera
