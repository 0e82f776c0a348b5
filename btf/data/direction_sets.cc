#include "btf/data/direction_sets.h"

#include <charconv>
#include <span>

#include <absl/status/status.h>
#include <absl/strings/str_cat.h>

namespace tessera {

namespace {

struct Ring {
  double theta_deg;
  int count;
};

constexpr Ring kUbo81[] = {{0.0, 1}, {15.0, 6}, {30.0, 12}, {45.0, 18}, {60.0, 20}, {75.0, 24}};
constexpr Ring kCuret[] = {{11.25, 4}, {33.75, 10}, {56.25, 16}, {78.75, 20}};
constexpr int kMaxPolar = 90;
constexpr int kMaxAzimuth = 360;
constexpr int kMaxGrid = 1024;

void AddRing(const Ring& ring, std::vector<Direction>& directions) {
  for (int i = 0; i < ring.count; ++i) {
    directions.push_back({RadFromDeg(ring.theta_deg), RadFromDeg(360.0 * i / ring.count)});
  }
}

std::vector<Direction> FromRings(std::span<const Ring> rings) {
  std::vector<Direction> directions;
  for (const Ring& ring : rings) {
    AddRing(ring, directions);
  }
  return directions;
}

// The whole of `text` as a decimal number in [1, limit], else 0.
int ParseCount(std::string_view text, int limit) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && value >= 1 && value <= limit ? value : 0;
}

}  // namespace

absl::StatusOr<std::vector<Direction>> DirectionSet(std::string_view name) {
  if (name == "ubo81") {
    return FromRings(kUbo81);
  }
  if (name == "curet") {
    return FromRings(kCuret);
  }
  const size_t cross = name.find('x');
  if (cross != std::string_view::npos) {
    const int num_polar = ParseCount(name.substr(0, cross), kMaxPolar);
    const int num_azimuth = ParseCount(name.substr(cross + 1), kMaxAzimuth);
    if (num_polar > 0 && num_azimuth > 0 && num_polar * num_azimuth <= kMaxGrid) {
      std::vector<Direction> directions;
      for (int i = 0; i < num_polar; ++i) {
        AddRing({90.0 * (i + 0.5) / num_polar, num_azimuth}, directions);
      }
      return directions;
    }
  }
  return absl::InvalidArgumentError(
      absl::StrCat("direction set '", absl::string_view(name.data(), name.size()),
                   "': expected ubo81, curet or NxM with N polar angles (1 to ", kMaxPolar,
                   ") and M azimuths (1 to ", kMaxAzimuth, "), N M at most ", kMaxGrid));
}

}  // namespace tessera
