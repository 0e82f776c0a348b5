#include "btf/data/sample_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"

namespace tessera {

namespace {

constexpr double kKeysPerDegree = 1000.0;
constexpr int64_t kFullTurn = 360'000;

// (polar, azimuth) in 1/1000 degree.
using AngleKey = std::pair<int64_t, int64_t>;

AngleKey KeyOf(const AnglesDeg& angles) {
  const int64_t polar = std::llround(angles.polar_deg * kKeysPerDegree);
  const int64_t azimuth = std::llround(angles.azimuth_deg * kKeysPerDegree);
  return {polar, polar == 0 ? 0 : (azimuth % kFullTurn + kFullTurn) % kFullTurn};
}

bool InRange(const AnglesDeg& angles) {
  // Written so that not-a-number fails.
  return angles.polar_deg >= 0.0 && angles.polar_deg <= 90.0 && angles.azimuth_deg >= -360.0 &&
         angles.azimuth_deg <= 720.0;
}

std::string Text(const AnglesDeg& angles) {
  return absl::StrCat("(", angles.polar_deg, ", ", angles.azimuth_deg, ")");
}

// The distinct directions in ascending order; afterwards the map holds each one's index.
std::vector<AnglesDeg> Number(std::map<AngleKey, std::pair<AnglesDeg, size_t>>& directions) {
  std::vector<AnglesDeg> angles;
  for (auto& [key, value] : directions) {
    value.second = angles.size();
    angles.push_back(key.first == 0 ? AnglesDeg{} : value.first);
  }
  return angles;
}

std::vector<Direction> ToRadians(std::span<const AnglesDeg> angles) {
  std::vector<Direction> directions;
  for (const AnglesDeg& angle : angles) {
    const double azimuth_deg = angle.azimuth_deg - 360.0 * std::floor(angle.azimuth_deg / 360.0);
    directions.push_back({RadFromDeg(angle.polar_deg), RadFromDeg(azimuth_deg)});
  }
  return directions;
}

}  // namespace

absl::StatusOr<SampleGrid> BuildSampleGrid(std::span<const SampleAngles> samples) {
  ErrorList out_of_range;
  std::map<AngleKey, std::pair<AnglesDeg, size_t>> view_keys;
  std::map<AngleKey, std::pair<AnglesDeg, size_t>> light_keys;
  for (const SampleAngles& sample : samples) {
    if (!InRange(sample.light) || !InRange(sample.view)) {
      out_of_range.Add(
          absl::StrCat(sample.name, " has light ", Text(sample.light), " view ", Text(sample.view)));
      continue;
    }
    view_keys.try_emplace(KeyOf(sample.view), sample.view, 0);
    light_keys.try_emplace(KeyOf(sample.light), sample.light, 0);
  }
  if (!out_of_range.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(
        out_of_range.count(), " of ", samples.size(),
        " images have angles beyond polar 0 to 90, azimuth -360 to 720 degrees: ", out_of_range.Text()));
  }
  const std::vector<AnglesDeg> views = Number(view_keys);
  const std::vector<AnglesDeg> lights = Number(light_keys);

  ErrorList duplicates;
  std::map<std::pair<size_t, size_t>, size_t> image_of_pair;  // (view, light) -> sample
  for (size_t i = 0; i < samples.size(); ++i) {
    const std::pair<size_t, size_t> pair = {view_keys.at(KeyOf(samples[i].view)).second,
                                            light_keys.at(KeyOf(samples[i].light)).second};
    const auto [found, inserted] = image_of_pair.try_emplace(pair, i);
    if (!inserted) {
      duplicates.Add(absl::StrCat(samples[found->second].name, " and ", samples[i].name, " (light ",
                                  Text(lights[pair.second]), ", view ", Text(views[pair.first]), ")"));
    }
  }
  // Missing pairs: at most one more than there are images is looked at for each that is named.
  ErrorList missing;
  const size_t num_missing = views.size() * lights.size() - image_of_pair.size();
  auto present = image_of_pair.begin();
  for (size_t pair = 0; missing.count() < std::min(num_missing, ErrorList::kNamed); ++pair) {
    const std::pair<size_t, size_t> wanted = {pair / lights.size(), pair % lights.size()};
    if (present != image_of_pair.end() && present->first == wanted) {
      ++present;
    } else {
      missing.Add(absl::StrCat("light ", Text(lights[wanted.second]), " view ", Text(views[wanted.first])));
    }
  }
  missing.AddUnnamed(num_missing - missing.count());
  if (!missing.empty() || !duplicates.empty()) {
    std::string message = absl::StrCat(samples.size(), " images of ", views.size(), " views x ",
                                       lights.size(), " lights (polar, azimuth in degrees)");
    if (!missing.empty()) {
      absl::StrAppend(&message, "; missing ", missing.count(), ": ", missing.Text());
    }
    if (!duplicates.empty()) {
      absl::StrAppend(&message, "; duplicate ", duplicates.count(), ": ", duplicates.Text());
    }
    return absl::InvalidArgumentError(message);
  }
  SampleGrid grid{ToRadians(views), ToRadians(lights), {}};
  for (const auto& [pair, index] : image_of_pair) {  // in order of view, then light
    grid.image.push_back(index);
  }
  return grid;
}

}  // namespace tessera
