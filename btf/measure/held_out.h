// A codec's error on the directions it was given, and on lights and views that it was not.
//
//   TESSERA_ASSIGN_OR_RETURN(HeldOutErrors errors,
//                            MeasureHeldOut(source, *FindCodec("dfmf"), {.rank = 32}, {}, context));
//   if (*errors.lights_rmse > bound) { .. }
#pragma once

#include <cstdint>
#include <optional>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/data/subset_btf.h"
#include "btf/measure/pair_errors.h"

namespace tessera {

// What is encoded and where its errors are taken: everything and everywhere; without every fifth light, at
// those lights under all views; without every fifth view, at those views under all lights.
enum class Split { kSampled, kHeldOutLights, kHeldOutViews };

// "sampled", "held-out lights", "held-out views".
[[nodiscard]] const char* SplitName(Split split);
// Whether the rule holds anything out: sets of fewer than kHeldOutStride directions keep all.
[[nodiscard]] bool SplitExists(const BtfInfo& info, Split split);
// Both for a split that exists.
[[nodiscard]] BtfSubset EncodedPart(const BtfInfo& info, Split split);
[[nodiscard]] PairSet MeasuredPairs(const BtfInfo& info, Split split);

struct HeldOutOptions {
  // Errors are taken of every n-th row of texels. All of them are encoded: where that is too much, give a
  // SubsetBtf of some texels as the source.
  int row_stride = 1;
};

// RMSE of linear RGB. Absent where the rule holds nothing out.
struct HeldOutErrors {
  double sampled_rmse = 0.0;
  std::optional<double> lights_rmse;
  std::optional<double> views_rmse;
  double reference_rms = 0.0;  // of all samples of those rows
  uint64_t size_bytes = 0;     // of the container with all directions
};

// Encodes up to three times, once a split, in the order above. Errors: those of Codec::Encode, of
// MeasureMaterial and of MaterialFile; CANCELLED.
[[nodiscard]] absl::StatusOr<HeldOutErrors> MeasureHeldOut(BtfSource& source, const Codec& codec,
                                                           const EncodeParams& params,
                                                           const HeldOutOptions& options,
                                                           const RunContext& context);

}  // namespace tessera
