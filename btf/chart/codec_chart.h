// Every codec and setting on one BTF: bytes, time to encode, cost to decode, and errors on the directions
// given and on those held out, against JPEG files of the same bytes.
//
//   TESSERA_ASSIGN_OR_RETURN(SourceChart chart, ChartCodecs("wool", *source, ChartSize::kFull, *gl,
//   context)); std::string csv = CodecsCsv({chart}); TESSERA_ASSIGN_OR_RETURN(std::string html,
//   CodecsHtml({chart}, {}));
//
// Each setting is encoded three times: on everything, without every fifth light, without every fifth view
// (measure/held_out.h). Bytes and costs are those of the first.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/chart/angle_limits.h"
#include "btf/chart/decode_cost.h"
#include "btf/chart/paper_table.h"
#include "btf/chart/settings.h"
#include "btf/data/btf_source.h"
#include "btf/image/image.h"
#include "btf/measure/held_out.h"

namespace tessera {

class OffscreenContext;

inline constexpr std::array<Split, 3> kSplits = {Split::kSampled, Split::kHeldOutLights,
                                                 Split::kHeldOutViews};

// Up to one limit of the polar angles.
struct LimitFigures {
  SquareSums squares;     // of all pairs, of every row_stride-th row
  int64_t num_pairs = 0;  // 0: the source has none up to here
  double dssim = 0.0;     // of the pictures chosen, see pictures.h
  double flip = 0.0;
  int num_pictures = 0;
};
using SplitFigures = std::array<LimitFigures, kNumAngleLimits>;

struct ChartPoint {
  std::string method;
  std::string setting;
  // Why there is nothing else: the codec's refusal. Empty where there is.
  std::string refusal;
  uint64_t size_bytes = 0;    // of the whole container; of all files
  double encode_s = 0.0;      // wall clock, with reading the source from memory
  double encode_cpu_s = 0.0;  // of all threads
  CpuDecodeCost cpu;
  std::optional<GlFrameCost> gl;  // JPEG has none
  std::array<std::optional<SplitFigures>, kSplits.size()> splits;
  std::vector<Image> crops;  // of SourceChart::crops
};

// One pair shown as pictures, the middle of the texture.
struct ChartCrop {
  std::string title;
  Split split = Split::kSampled;  // decoded from what was encoded for it
  int view = 0;
  int light = 0;
  Image reference;
};

// Settings of about equal bytes, one a method.
struct CropGroup {
  std::string title;
  std::vector<size_t> points;  // indices into SourceChart::points
};

struct SourceChart {
  std::string name;
  std::string part;  // what of it is charted, when not all
  int width = 0;
  int height = 0;
  std::vector<Direction> views;
  std::vector<Direction> lights;
  std::string radiometry;
  ChartSize size = ChartSize::kFull;
  int row_stride = 1;
  int pictures_per_class = 0;
  std::vector<ChartPoint> points;
  std::vector<ChartCrop> crops;
  std::vector<CropGroup> groups;

  // Of 8-bit RGB images: what compression is measured against.
  [[nodiscard]] uint64_t RawBytes() const {
    return uint64_t{3} * width * height * views.size() * lights.size();
  }
};

// Most that the copies of a source take, for as many times as it is read.
inline constexpr uint64_t kChartSourceBytes = uint64_t{4} << 30;

// `source` should be quick to read again and again. kQuick takes the middle kQuickSide texels. Progress in
// "steps" of the stage "chart". Memory: a byte a sample of the source for JPEG, the largest material, and
// what Encode takes. Errors: INVALID_ARGUMENT (a sample that no codec takes), RESOURCE_EXHAUSTED (more than
// kChartSourceBytes for JPEG), those of the source and of GL; CANCELLED. A codec's refusal of a setting is
// not an error but a ChartPoint.
[[nodiscard]] absl::StatusOr<SourceChart> ChartCodecs(const std::string& name, BtfSource& source,
                                                      ChartSize size, OffscreenContext& gl,
                                                      const RunContext& context);
inline constexpr int kQuickSide = 64;

// One row each source, method, setting, split and limit of the angles. README.md describes the columns.
[[nodiscard]] std::string CodecsCsv(const std::vector<SourceChart>& charts);

// One self-contained page, with the paper's table where there is one. Errors: INTERNAL (a picture).
[[nodiscard]] absl::StatusOr<std::string> CodecsHtml(const std::vector<SourceChart>& charts,
                                                     const std::vector<PaperRow>& paper);

}  // namespace tessera
