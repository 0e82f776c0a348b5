#include "btf/codec/encoder_input.h"

#include <algorithm>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

absl::Status CheckSourceDirections(const std::vector<Direction>& directions, const char* name,
                                   size_t max_directions) {
  if (directions.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("the BTF has no ", name));
  }
  if (directions.size() > max_directions) {
    return absl::InvalidArgumentError(
        absl::StrCat("the BTF has ", directions.size(), " ", name, ", at most ", max_directions));
  }
  for (size_t i = 0; i < directions.size(); ++i) {
    constexpr double kRounding = 1e-9;
    const Direction& d = directions[i];
    if (!std::isfinite(d.phi_rad) || !(d.theta_rad >= 0.0 && d.theta_rad <= kPi / 2.0 + kRounding)) {
      return absl::InvalidArgumentError(absl::StrCat(name, "[", i, "]: polar angle ", DegFromRad(d.theta_rad),
                                                     " degrees, azimuth ", DegFromRad(d.phi_rad),
                                                     ", expected a polar angle from 0 to 90"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckEncoderInput(const BtfInfo& info, size_t max_directions) {
  if (info.width < 1 || info.height < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("the BTF is ", info.width, "x", info.height, " texels, expected at least 1x1"));
  }
  TESSERA_RETURN_IF_ERROR(CheckSourceDirections(info.views, "views", max_directions));
  return CheckSourceDirections(info.lights, "lights", max_directions);
}

absl::Status IllegalSampleError(const BtfInfo& info, int row_begin, std::span<const float> samples) {
  const auto it = std::ranges::find_if_not(samples, IsLegalSample);
  if (it == samples.end()) {
    return absl::InternalError("samples were refused, but none is illegal");
  }
  size_t index = static_cast<size_t>(it - samples.begin());
  const auto take = [&index](size_t extent) {
    const size_t value = index % extent;
    index /= extent;
    return value;
  };
  const size_t light = take(info.lights.size());
  const size_t view = take(info.views.size());
  const size_t channel = take(3);
  const size_t x = take(static_cast<size_t>(info.width));
  return absl::InvalidArgumentError(absl::StrCat(
      "view ", view, ", light ", light, ", texel (", x, ", ", static_cast<size_t>(row_begin) + index,
      "), channel ", channel, ": sample ", *it, ", expected a finite value up to ", kLargestSample));
}

}  // namespace tessera
