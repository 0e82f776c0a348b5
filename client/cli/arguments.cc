#include "client/cli/arguments.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include <fmt/format.h>

#include "btf/base/status_macros.h"
#include "client/cli/exit_codes.h"

namespace tessera::cli {
namespace {

constexpr uint32_t kSmallestPicture = 16;
constexpr uint32_t kLargestPicture = 8192;
constexpr double kLargestPolarDeg = 90.0;

// Comma-separated finite numbers; nothing when one of them is not.
std::optional<std::vector<double>> ParseNumbers(std::string_view text) {
  std::vector<double> numbers;
  while (true) {
    const size_t comma = text.find(',');
    const std::string_view part = text.substr(0, comma);
    double value = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    if (error != std::errc() || end != part.data() + part.size() || !std::isfinite(value)) {
      return std::nullopt;
    }
    numbers.push_back(value);
    if (comma == std::string_view::npos) {
      return numbers;
    }
    text.remove_prefix(comma + 1);
  }
}

absl::Status Misread(std::string_view what, std::string_view text, std::string_view form) {
  return UsageError(fmt::format("{} \"{}\": expected {}", what, text, form));
}

std::optional<uint32_t> ParseCount(std::string_view text) {
  uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) {
    return std::nullopt;
  }
  return value;
}

}  // namespace

absl::StatusOr<PictureSize> ParsePictureSize(std::string_view text) {
  const size_t x = text.find('x');
  if (x != std::string_view::npos) {
    const auto width = ParseCount(text.substr(0, x));
    const auto height = ParseCount(text.substr(x + 1));
    const auto legal = [](const std::optional<uint32_t>& side) {
      return side && *side >= kSmallestPicture && *side <= kLargestPicture;
    };
    if (legal(width) && legal(height)) {
      return PictureSize{*width, *height};
    }
  }
  return Misread("size", text, fmt::format("WxH, each {} to {}", kSmallestPicture, kLargestPicture));
}

absl::StatusOr<Direction> ParseDirection(std::string_view text) {
  const auto numbers = ParseNumbers(text);
  if (!numbers || numbers->size() != 2 || (*numbers)[0] < 0 || (*numbers)[0] > kLargestPolarDeg) {
    return Misread("direction", text, "TH,PH in degrees, TH 0 to 90");
  }
  return Direction{RadFromDeg((*numbers)[0]), RadFromDeg((*numbers)[1])};
}

absl::StatusOr<v1::Light> ParseLight(std::string_view text) {
  constexpr std::string_view kPoint = "point:";
  constexpr std::string_view kForm =
      "TH,PH[,SCALE] in degrees or point:X,Y,Z[,SCALE], SCALE above 0 or three for red, green, blue";
  const bool is_point = text.starts_with(kPoint);
  const auto numbers = ParseNumbers(is_point ? text.substr(kPoint.size()) : text);
  const size_t num_place = is_point ? 3 : 2;
  if (!numbers || numbers->size() < num_place) {
    return Misread("light", text, kForm);
  }
  std::vector<double> scales(numbers->begin() + static_cast<ptrdiff_t>(num_place), numbers->end());
  if (scales.size() <= 1) {
    scales.assign(3, scales.empty() ? 1.0 : scales[0]);
  }
  if (scales.size() != 3 || *std::ranges::min_element(scales) < 0 || *std::ranges::max_element(scales) <= 0) {
    return Misread("light", text, kForm);
  }
  v1::Light light;
  if (is_point) {
    light.set_kind(v1::Light::POINT);
    light.set_x((*numbers)[0]);
    light.set_y((*numbers)[1]);
    light.set_z((*numbers)[2]);
  } else {
    // Any polar angle: a mesh has sides that no upper hemisphere lights.
    const double theta = RadFromDeg((*numbers)[0]);
    const double phi = RadFromDeg((*numbers)[1]);
    light.set_kind(v1::Light::DIRECTIONAL);
    light.set_x(std::sin(theta) * std::cos(phi));
    light.set_y(std::sin(theta) * std::sin(phi));
    light.set_z(std::cos(theta));
  }
  light.set_red(scales[0] * kPi);
  light.set_green(scales[1] * kPi);
  light.set_blue(scales[2] * kPi);
  return light;
}

absl::StatusOr<std::array<double, 3>> ParsePlace(std::string_view what, std::string_view text) {
  const auto numbers = ParseNumbers(text);
  if (!numbers || numbers->size() != 3) {
    return Misread(what, text, "X,Y,Z");
  }
  return std::array<double, 3>{(*numbers)[0], (*numbers)[1], (*numbers)[2]};
}

absl::StatusOr<v1::Orbit> ParseOrbit(std::string_view text) {
  const auto numbers = ParseNumbers(text);
  if (!numbers || numbers->size() < 2 || numbers->size() > 3 ||
      (numbers->size() == 3 && (*numbers)[2] <= 0)) {
    return Misread("orbit", text, "AZ,EL[,DISTANCE], degrees and a factor above 0");
  }
  v1::Orbit orbit;
  orbit.set_azimuth_deg((*numbers)[0]);
  orbit.set_elevation_deg((*numbers)[1]);
  orbit.set_distance(numbers->size() == 3 ? (*numbers)[2] : 1.0);
  return orbit;
}

absl::StatusOr<PictureFormat> PictureFormatOf(std::string_view path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".png") {
    return PictureFormat::kPng;
  }
  if (ending == ".exr") {
    return PictureFormat::kExr;
  }
  return Misread("output", path, "a name ending in .png or .exr");
}

std::optional<std::string> BuiltinName(std::string_view text) {
  constexpr std::string_view kBuiltin = "builtin:";
  if (!text.starts_with(kBuiltin)) {
    return std::nullopt;
  }
  return std::string(text.substr(kBuiltin.size()));
}

}  // namespace tessera::cli
