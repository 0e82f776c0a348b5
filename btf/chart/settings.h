// Which codecs at which settings the chart compares.
#pragma once

#include <string>
#include <vector>

#include "btf/codec/codec.h"

namespace tessera {

struct ChartSetting {
  std::string method;   // "dsh-cls", "dsh-cls 4pi"
  std::string setting;  // "25x25", "c 5", "rank 48"
  std::string codec;
  EncodeParams params;
};

enum class ChartSize { kFull, kQuick };

// In order of method, then of growing size.
[[nodiscard]] std::vector<ChartSetting> ChartSettings(ChartSize size);
// The qualities at which JPEG is charted.
[[nodiscard]] std::vector<int> ChartJpegQualities(ChartSize size);

inline constexpr char kJpegMethod[] = "JPEG images";

}  // namespace tessera
