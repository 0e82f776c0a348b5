#include "btf/choice/ladder_search.h"

#include <utility>

#include "btf/base/status_macros.h"

namespace tessera {

absl::StatusOr<bool> LadderSearch::Measure(size_t rung) {
  if (!refusal_.ok()) {
    return false;
  }
  if (measured_.contains(rung)) {
    return true;
  }
  absl::StatusOr<SettingFigures> figures = meter_(ladder_.rungs[rung]);
  if (figures.ok()) {
    measured_[rung] = *figures;
    return true;
  }
  if (absl::IsInvalidArgument(figures.status()) || absl::IsResourceExhausted(figures.status())) {
    refusal_ = figures.status();
    return false;
  }
  return figures.status();
}

std::optional<size_t> LadderSearch::Best(uint64_t max_bytes) const {
  std::optional<size_t> best;
  for (const auto& [rung, figures] : measured_) {
    if (figures.bytes <= max_bytes && (!best || figures.error() < measured_.at(*best).error())) {
      best = rung;
    }
  }
  return best;
}

absl::Status LadderSearch::Climb(const ModelBound& bound) {
  const auto may_fit = [&](const Setting& setting) { return setting.code_bytes <= bound.max_bytes; };
  const size_t num_fitting =
      static_cast<size_t>(std::ranges::find_if_not(ladder_.rungs, may_fit) - ladder_.rungs.begin());
  if (num_fitting == 0) {
    return absl::OkStatus();
  }
  std::vector<size_t> stops;
  std::ranges::copy_if(ladder_.stops, std::back_inserter(stops),
                       [&](size_t stop) { return stop < num_fitting; });
  if (stops.empty() || stops.back() + 1 < num_fitting) {
    stops.push_back(num_fitting - 1);
  }
  double error = std::numeric_limits<double>::infinity();
  size_t last = 0;
  for (size_t stop : stops) {
    while (true) {
      TESSERA_ASSIGN_OR_RETURN(const bool is_measured, Measure(stop));
      if (!is_measured) {
        return absl::OkStatus();
      }
      // The tables may be too much.
      if (measured_.at(stop).bytes <= bound.max_bytes || stop == 0) {
        break;
      }
      --stop;
    }
    last = stop;
    const SettingFigures& figures = measured_.at(stop);
    if (bound.IsMet(figures) || figures.bytes > bound.max_bytes ||
        figures.error() > (1.0 - kLeastGain) * error) {
      break;
    }
    error = figures.error();
  }
  // Where the error falls and rises again, it is lowest around the best stop.
  for (std::optional<size_t> best = Best(bound.max_bytes); best && !bound.IsMet(measured_.at(*best));) {
    for (const size_t rung : {*best - 1, *best + 1}) {  // *best - 1 wraps where there is none
      if (rung < last) {
        TESSERA_RETURN_IF_ERROR(Measure(rung).status());
      }
    }
    const std::optional<size_t> next = Best(bound.max_bytes);
    if (next == best) {
      break;
    }
    best = next;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<size_t>> LadderSearch::SmallestWithin(const ModelBound& bound) {
  TESSERA_RETURN_IF_ERROR(Climb(bound));
  const auto first =
      std::ranges::find_if(measured_, [&](const auto& measured) { return bound.IsMet(measured.second); });
  if (first == measured_.end()) {
    return std::nullopt;
  }
  size_t meets = first->first;
  // The rung that fails closest below, or the ground.
  size_t first_unknown = first == measured_.begin() ? 0 : std::prev(first)->first + 1;
  while (first_unknown < meets) {
    const size_t middle = first_unknown + (meets - first_unknown) / 2;
    TESSERA_ASSIGN_OR_RETURN(const bool is_measured, Measure(middle));
    if (is_measured && bound.IsMet(measured_.at(middle))) {
      meets = middle;
    } else {
      first_unknown = middle + 1;
    }
  }
  return meets;
}

absl::StatusOr<std::optional<size_t>> LadderSearch::MostAccurateWithin(uint64_t max_bytes) {
  TESSERA_RETURN_IF_ERROR(Climb({.max_error = -1.0, .max_bytes = max_bytes}));
  return Best(max_bytes);
}

}  // namespace tessera
