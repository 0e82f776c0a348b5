// What decoding a material costs, measured: on one core of the CPU, and as a GL frame.
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/material.h"

namespace tessera {

class OffscreenContext;

// Seconds of processor time of one thread, a texel; minima of kDecodeRounds rounds.
struct CpuDecodeCost {
  double streaming_s = 0.0;  // DecodeTexels: all texels of one light and view
  double random_s = 0.0;     // Decode: another texel, light and view each time
};
inline constexpr int kDecodeRounds = 3;

// Errors: MakeDecoder's; CANCELLED.
[[nodiscard]] absl::StatusOr<CpuDecodeCost> MeasureCpuDecode(const Material& material,
                                                             const RunContext& context);

// Seconds of wall-clock time, minima of as many further pictures as fit in 0.4 s, one to three: a frame
// of kFrameWidth x kFrameHeight that a plane covers whole, facing the eye, kFrameTexelsPerPixel texels to the
// pixel, its texels the material's (the largest square of them from the top left, repeated).
struct GlFrameCost {
  double nearest_s = 0.0;   // one texel a pixel
  double bilinear_s = 0.0;  // four
  double prepare_s = 0.0;   // GlPreview::Create, before the first: packing and sending the tables
};
inline constexpr int kFrameWidth = 640;
inline constexpr int kFrameHeight = 480;
inline constexpr double kFrameTexelsPerPixel = 0.7;

// Errors: GlPreview's; CANCELLED.
[[nodiscard]] absl::StatusOr<GlFrameCost> MeasureGlFrame(OffscreenContext& context, const Material& material,
                                                         const RunContext& run_context);

}  // namespace tessera
