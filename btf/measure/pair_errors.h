// Squared errors of decoded images, for every pair of a view and a light: what errors on any set of
// directions are sums of.
//
//   TESSERA_ASSIGN_OR_RETURN(PairErrors errors, MeasureMaterial(source, material, pairs, 1, context));
//   double rmse = Total(errors).rmse();
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Every view with every light. Indices into the source's directions.
struct PairSet {
  std::vector<int> views;
  std::vector<int> lights;

  [[nodiscard]] size_t size() const { return views.size() * lights.size(); }
};

// Sums over texels and channels.
struct SquareSums {
  double errors = 0.0;        // of linear values
  double references = 0.0;    // of linear values
  double coded_errors = 0.0;  // of sRGB-coded values clamped to [0, 1]
  int64_t num_samples = 0;

  void Add(const SquareSums& other);
  [[nodiscard]] double rmse() const;
  [[nodiscard]] double reference_rms() const;
  // rmse() / reference_rms(); 0 where both are, infinite where only the latter is.
  [[nodiscard]] double relative_rmse() const;
  [[nodiscard]] double psnr_db() const;  // of coded values, peak 1; infinite without error
};

struct PairErrors {
  PairSet pairs;
  std::vector<SquareSums> sums;  // [view][light] of `pairs`
};
// All of them, in order.
[[nodiscard]] SquareSums Total(const PairErrors& errors);

// Fills `rgb` [width][3] with what stands for row `y` of the image of these directions, indices into the
// source's. Called from several threads at once.
using RowPredictor = std::function<void(int y, int view, int light, std::span<float> rgb)>;

// Compares rows 0, row_stride, 2 row_stride, .. of the source with their prediction. Reads each of them once;
// holds two rows of samples. The same for any number of threads. Errors: INVALID_ARGUMENT (row_stride < 1, no
// pairs, an index out of range); those of the source; CANCELLED.
[[nodiscard]] absl::StatusOr<PairErrors> MeasurePairs(BtfSource& source, const RowPredictor& predict,
                                                      const PairSet& pairs, int row_stride,
                                                      const RunContext& context);

// The same with the rows that `material` decodes to; it may have been encoded with fewer directions. Errors:
// also INVALID_ARGUMENT when the sizes differ; those of MakeDecoder.
[[nodiscard]] absl::StatusOr<PairErrors> MeasureMaterial(BtfSource& source, const Material& material,
                                                         const PairSet& pairs, int row_stride,
                                                         const RunContext& context);

}  // namespace tessera
