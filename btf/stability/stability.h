// Every codec where it fails: one row for each case and method, with its figures, what the product says or
// does about it, and the figure that it must stay below.
//
//   TESSERA_ASSIGN_OR_RETURN(std::vector<StabilityRow> rows, RunStability(context));
//   std::string csv = StabilityCsv(rows);
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"

namespace tessera {

// Errors are root mean squares over the root mean square of the truth, which has no noise, outlier or
// clipping.
struct StabilityRow {
  std::string stress;  // what is done to the method: "noise 20 dB"
  std::string method;  // a codec's id, "import"
  std::string setting;
  bool is_refused = false;
  // Absent where nothing was encoded.
  std::optional<double> measured_error;    // at the measured directions
  std::optional<double> everywhere_error;  // at directions in between and beyond, as the format extends them
  std::optional<double> largest_value;     // decoded, over the largest of the truth
  std::optional<double> largest_coefficient;
  std::optional<double> condition;  // of the normal matrix in the worse of the two passes
  std::optional<double> error_before_quantisation;
  std::string says;  // warnings, or the refusal
  // What the row promises: a refusal, or `everywhere_error` at most `limit`. Finite values, always.
  std::optional<double> limit;
  bool holds = false;
};

// About a minute on two cores; deterministic. Progress in cases. Errors: CANCELLED.
[[nodiscard]] absl::StatusOr<std::vector<StabilityRow>> RunStability(const RunContext& context);

[[nodiscard]] std::string StabilityCsv(const std::vector<StabilityRow>& rows);
// One self-contained page.
[[nodiscard]] std::string StabilityHtml(const std::vector<StabilityRow>& rows);

}  // namespace tessera
