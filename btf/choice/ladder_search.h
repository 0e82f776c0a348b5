// Finds the rung of a ladder that a bound asks for, measuring few of them.
//
//   LadderSearch search(ladder, [&](const Setting& setting) { return Measure(setting); });
//   TESSERA_ASSIGN_OR_RETURN(std::optional<size_t> rung, search.SmallestWithin({.max_error = 0.05}));
//
// A search climbs by the ladder's stops until one meets the bound, then halves what lies below. It gives up
// climbing where a stop lowers the error by less than kLeastGain: the error has levelled off.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include <absl/status/statusor.h>

#include "btf/choice/ladder.h"

namespace tessera {

inline constexpr double kLeastGain = 0.02;

// What one setting costs and how far off it is. Errors are root mean squares over linear RGB, absolute.
struct SettingFigures {
  uint64_t bytes = 0;                 // of the whole container
  int coefficients_read = 0;          // of a texel for one light and view: what decoding costs
  std::optional<double> lights_rmse;  // held-out lights; absent where there are fewer than five lights
  std::optional<double> views_rmse;   // held-out views, likewise
  // At the directions encoded, of the finished material; absent before there is one.
  std::optional<double> sampled_rmse;
  bool of_all_texels = false;  // encoded from all of them, not from a part

  // The worst of them: what a bound is compared with.
  [[nodiscard]] double error() const {
    return std::max({lights_rmse.value_or(0.0), views_rmse.value_or(0.0), sampled_rmse.value_or(0.0)});
  }
};

struct ModelBound {
  double max_error = std::numeric_limits<double>::infinity();
  uint64_t max_bytes = std::numeric_limits<uint64_t>::max();

  [[nodiscard]] bool IsMet(const SettingFigures& figures) const {
    return figures.error() <= max_error && figures.bytes <= max_bytes;
  }
};

class LadderSearch {
 public:
  using Meter = std::function<absl::StatusOr<SettingFigures>(const Setting&)>;

  LadderSearch(Ladder ladder, Meter meter) : ladder_(std::move(ladder)), meter_(std::move(meter)) {}

  // The lowest rung that meets the bound; none when none does. Errors: CANCELLED, INTERNAL and whatever else
  // the meter returns but INVALID_ARGUMENT and RESOURCE_EXHAUSTED: those mean that the codec cannot take this
  // BTF (refusal()).
  [[nodiscard]] absl::StatusOr<std::optional<size_t>> SmallestWithin(const ModelBound& bound);
  // The most accurate rung of at most so many bytes; none when none fits. Errors: as above.
  [[nodiscard]] absl::StatusOr<std::optional<size_t>> MostAccurateWithin(uint64_t max_bytes);

  // Puts better figures in the place of a rung's.
  void Correct(size_t rung, const SettingFigures& figures) { measured_[rung] = figures; }

  [[nodiscard]] const Ladder& ladder() const { return ladder_; }
  // Rungs measured so far.
  [[nodiscard]] const std::map<size_t, SettingFigures>& measured() const { return measured_; }
  // Why the codec cannot take this BTF; OK while it can.
  [[nodiscard]] const absl::Status& refusal() const { return refusal_; }

 private:
  // False when the codec refused.
  [[nodiscard]] absl::StatusOr<bool> Measure(size_t rung);
  [[nodiscard]] absl::Status Climb(const ModelBound& bound);
  [[nodiscard]] std::optional<size_t> Best(uint64_t max_bytes) const;

  Ladder ladder_;
  Meter meter_;
  std::map<size_t, SettingFigures> measured_;
  absl::Status refusal_;
};

}  // namespace tessera
