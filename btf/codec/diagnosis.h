// What a finished material gives reason to warn of: where its codec or its data are weak, before a picture
// shows it.
//
//   TESSERA_ASSIGN_OR_RETURN(const Diagnosis diagnosis, DiagnoseMaterial(*source, material, context));
//   TESSERA_RETURN_IF_ERROR(RecordDiagnosis(*source, context, material));   // the same, in its metadata
#pragma once

#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Figures are of a few texels (at most kDiagnosedTexels, evenly spread over two rows) in every image.
struct Diagnosis {
  double rms = 0.0;   // of the samples
  double rmse = 0.0;  // of the decoded values against them
  // Root mean square of what rounding the codes to 8 bits does to a decoded value.
  double quantisation_noise = 0.0;
  double negative_share = 0.0;  // of decoded values that the clamp at 0 raised by more than 1% of `rms`
  // Of the samples that equal the largest; 0 when all are equal.
  double saturated_share = 0.0;
  // The image that fits worst, and its RMSE over that of the median image or 0.1% of `rms`, whichever is
  // larger; 0 when it is below 0.1% of `rms` itself.
  size_t worst_view = 0;
  size_t worst_light = 0;
  double worst_image_ratio = 0.0;
  size_t num_like_worst = 0;  // images with more than half its RMSE, itself included
  // The largest angle to the nearest measured direction, among directions up to the largest measured polar
  // angle; and that polar angle.
  double view_gap_rad = 0.0;
  double light_gap_rad = 0.0;
  double largest_view_theta_rad = 0.0;
  double largest_light_theta_rad = 0.0;
  std::vector<std::string> warnings;  // one sentence each, with its figure and its limit
};

inline constexpr int kDiagnosedTexels = 64;

// What is warned of:
inline constexpr double kErrorLimit = 0.25;             // rmse / rms above it
inline constexpr double kQuantisationNoiseLimit = 0.1;  // quantisation_noise / rms above it
inline constexpr double kNegativeShareLimit = 0.1;
inline constexpr double kSaturatedShareLimit = 0.01;
inline constexpr double kWorstImageLimit =
    12.0;  // where no more than one image in kImagesPerDamaged is like it
inline constexpr size_t kImagesPerDamaged = 1000;
inline constexpr double kDirectionGapLimitDeg = 25.0;
inline constexpr double kSmallestThetaLimitDeg = 60.0;  // largest measured polar angle below it

// `source` is the one that `material` was made from; two of its rows are read. Errors: INVALID_ARGUMENT when
// they do not belong together, CANCELLED, whatever the source returns.
[[nodiscard]] absl::StatusOr<Diagnosis> DiagnoseMaterial(BtfSource& source, const Material& material,
                                                         const RunContext& context);

// material.metadata["diagnosis"]: keys as the members are named, angles in degrees. Errors: as above.
[[nodiscard]] absl::Status RecordDiagnosis(BtfSource& source, const RunContext& context, Material& material);

}  // namespace tessera
