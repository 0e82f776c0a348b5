#include "btf/choice/choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/reason.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

std::string BytesText(uint64_t bytes) {
  constexpr std::array kUnits = {"bytes", "KiB", "MiB", "GiB", "TiB"};
  constexpr double kStep = 1024.0;
  double amount = static_cast<double>(bytes);
  size_t unit = 0;
  while (amount >= kStep && unit + 1 < kUnits.size()) {
    amount /= kStep;
    ++unit;
  }
  return absl::StrFormat(unit == 0 ? "%.0f %s" : "%.1f %s", amount, kUnits[unit]);
}

std::string ErrorsText(const SettingFigures& figures) {
  std::string text;
  const auto add = [&text](const char* where, const std::optional<double>& rmse) {
    if (rmse) {
      absl::StrAppendFormat(&text, "%s%.4g on %s", text.empty() ? "" : ", ", *rmse, where);
    }
  };
  add("held-out lights", figures.lights_rmse);
  add("held-out views", figures.views_rmse);
  add("the directions encoded", figures.sampled_rmse);
  return text;
}

nlohmann::json JsonOf(const std::string& codec, const Setting& setting, const SettingFigures& figures) {
  nlohmann::json json = {{"codec", codec},
                         {"setting", setting.label},
                         {"bytes", figures.bytes},
                         {"coefficients_read", figures.coefficients_read},
                         {"of_all_texels", figures.of_all_texels}};
  const auto add = [&json](const char* key, const std::optional<double>& rmse) {
    if (rmse) {
      json[key] = *rmse;
    }
  };
  add("held_out_lights_rmse", figures.lights_rmse);
  add("held_out_views_rmse", figures.views_rmse);
  add("sampled_rmse", figures.sampled_rmse);
  return json;
}

std::string GoalText(const ModelGoal& goal) {
  return goal.max_bytes > 0 ? absl::StrCat("max_bytes = ", goal.max_bytes)
                            : absl::StrCat("max_error = ", goal.max_error);
}

}  // namespace

ModelChooser::ModelChooser(const ModelGoal& goal, std::vector<Ladder> ladders, const Meter& meter)
    : goal_(goal) {
  for (Ladder& ladder : ladders) {
    std::string codec = ladder.codec;
    searches_.emplace_back(std::move(ladder),
                           [codec, meter](const Setting& setting) { return meter(codec, setting); });
  }
}

bool ModelChooser::IsPreferred(const Ladder& ladder) const {
  return goal_.light == SceneLight::kPoint || ladder.projects_on_harmonics;
}

absl::StatusOr<ModelBound> ModelChooser::BoundOfGoal() {
  if (goal_.max_bytes == 0) {
    return ModelBound{.max_error = goal_.max_error};
  }
  // The lowest error that fits: of what is preferred, and of all.
  double preferred = std::numeric_limits<double>::infinity();
  double any = preferred;
  for (LadderSearch& search : searches_) {
    TESSERA_ASSIGN_OR_RETURN(const std::optional<size_t> best, search.MostAccurateWithin(goal_.max_bytes));
    if (best) {
      const double error = search.measured().at(*best).error();
      any = std::min(any, error);
      if (IsPreferred(search.ladder())) {
        preferred = std::min(preferred, error);
      }
    }
  }
  return ModelBound{.max_error = kEqualErrors * (std::isfinite(preferred) ? preferred : any),
                    .max_bytes = goal_.max_bytes};
}

absl::StatusOr<ModelChoice> ModelChooser::Choose() {
  TESSERA_ASSIGN_OR_RETURN(bound_, BoundOfGoal());
  std::vector<ModelChoice> meeting;
  for (size_t i = 0; i < searches_.size(); ++i) {
    TESSERA_ASSIGN_OR_RETURN(const std::optional<size_t> rung, searches_[i].SmallestWithin(bound_));
    if (rung) {
      meeting.push_back({i, *rung});
    }
  }
  if (meeting.empty()) {
    return NotReached();
  }
  const auto is_preferred = [&](const ModelChoice& choice) {
    return IsPreferred(searches_[choice.ladder].ladder());
  };
  if (std::ranges::any_of(meeting, is_preferred)) {
    std::erase_if(meeting, [&](const ModelChoice& choice) { return !is_preferred(choice); });
  }
  const auto bytes = [&](const ModelChoice& choice) { return FiguresOf(choice).bytes; };
  const auto most = static_cast<double>(bytes(std::ranges::min(meeting, {}, bytes))) * kEqualBytes;
  std::erase_if(meeting,
                [&](const ModelChoice& choice) { return static_cast<double>(bytes(choice)) > most; });
  return std::ranges::min(meeting, {}, [&](const ModelChoice& choice) {
    return std::tuple(FiguresOf(choice).coefficients_read, FiguresOf(choice).error(), choice.ladder);
  });
}

absl::Status ModelChooser::NotReached() const {
  // The figure that came closest to the bound.
  const LadderSearch* closest = nullptr;
  size_t closest_rung = 0;
  const auto distance = [&](const SettingFigures& figures) {
    return goal_.max_bytes > 0 ? static_cast<double>(figures.bytes) : figures.error();
  };
  for (const LadderSearch& search : searches_) {
    for (const auto& [rung, figures] : search.measured()) {
      if (closest == nullptr || distance(figures) < distance(closest->measured().at(closest_rung))) {
        closest = &search;
        closest_rung = rung;
      }
    }
  }
  if (closest == nullptr) {
    for (const LadderSearch& search : searches_) {
      TESSERA_RETURN_IF_ERROR(search.refusal());
    }
    // Nothing was measured because not even the codes fit.
    const LadderSearch* smallest = &*std::ranges::min_element(
        searches_, {}, [](const LadderSearch& search) { return search.ladder().rungs[0].code_bytes; });
    return WithReason(absl::FailedPreconditionError(absl::StrFormat(
                          "%s: the codes of the smallest model, %s %s, take %d bytes", GoalText(goal_),
                          smallest->ladder().codec, smallest->ladder().rungs[0].label,
                          smallest->ladder().rungs[0].code_bytes)),
                      "BOUND_NOT_REACHED", "max_bytes");
  }
  const SettingFigures& figures = closest->measured().at(closest_rung);
  const std::string setting =
      absl::StrCat(closest->ladder().codec, " ", closest->ladder().rungs[closest_rung].label);
  if (goal_.max_bytes > 0) {
    return WithReason(
        absl::FailedPreconditionError(absl::StrFormat("%s: the smallest model, %s, takes %d bytes",
                                                      GoalText(goal_), setting, figures.bytes)),
        "BOUND_NOT_REACHED", "max_bytes");
  }
  return WithReason(
      absl::FailedPreconditionError(absl::StrFormat(
          "%s is not reached on held-out directions: the best is %.4g by %s (%s), %.3g times the bound",
          GoalText(goal_), figures.error(), setting, ErrorsText(figures), figures.error() / goal_.max_error)),
      "BOUND_NOT_REACHED", "max_error");
}

void ModelChooser::Correct(const ModelChoice& choice, const SettingFigures& figures) {
  searches_[choice.ladder].Correct(choice.rung, figures);
}

const std::string& ModelChooser::CodecOf(const ModelChoice& choice) const {
  return searches_[choice.ladder].ladder().codec;
}

const Setting& ModelChooser::SettingOf(const ModelChoice& choice) const {
  return searches_[choice.ladder].ladder().rungs[choice.rung];
}

const SettingFigures& ModelChooser::FiguresOf(const ModelChoice& choice) const {
  return searches_[choice.ladder].measured().at(choice.rung);
}

std::vector<ModelChooser::Rejection> ModelChooser::Rejections(const ModelChoice& choice) const {
  const SettingFigures& chosen = FiguresOf(choice);
  const auto too_far = [&](const SettingFigures& figures) {
    return absl::StrFormat("error %.4g, %.3g times the bound %.4g", figures.error(),
                           figures.error() / bound_.max_error, bound_.max_error);
  };
  std::vector<Rejection> rejections;
  for (size_t i = 0; i < searches_.size(); ++i) {
    const LadderSearch& search = searches_[i];
    const auto& measured = search.measured();
    const auto reject = [&](std::optional<size_t> rung, std::string why) {
      rejections.push_back({i, rung, std::move(why)});
    };
    if (!search.refusal().ok()) {
      reject(std::nullopt, std::string(search.refusal().message()));
    } else if (measured.empty()) {
      reject(std::nullopt, absl::StrCat("the codes of ", search.ladder().rungs[0].label, " alone take ",
                                        BytesText(search.ladder().rungs[0].code_bytes)));
    } else if (i == choice.ladder) {
      // The next smaller setting, which fails.
      const auto next = measured.lower_bound(choice.rung);
      if (next != measured.begin()) {
        reject(std::prev(next)->first, too_far(std::prev(next)->second));
      }
    } else if (const auto meets =
                   std::ranges::find_if(measured, [&](const auto& m) { return bound_.IsMet(m.second); });
               meets != measured.end()) {
      const SettingFigures& figures = meets->second;
      reject(
          meets->first,
          absl::StrFormat("error %.4g, %s, %.3g times the bytes, %d coefficients a look-up%s",
                          figures.error(), BytesText(figures.bytes),
                          static_cast<double>(figures.bytes) / static_cast<double>(chosen.bytes),
                          figures.coefficients_read,
                          IsPreferred(search.ladder()) ? "" : "; does not project on spherical harmonics"));
    } else {
      const auto best = std::ranges::min_element(measured, {}, [&](const auto& m) {
        return std::pair(m.second.bytes > bound_.max_bytes, m.second.error());
      });
      const SettingFigures& figures = best->second;
      reject(best->first,
             figures.bytes > bound_.max_bytes
                 ? absl::StrFormat("%s, %.3g times the bound", BytesText(figures.bytes),
                                   static_cast<double>(figures.bytes) / static_cast<double>(bound_.max_bytes))
                 : absl::StrCat("its best, ", too_far(figures)));
    }
  }
  return rejections;
}

nlohmann::json ModelChooser::Record(const ModelChoice& choice) const {
  const SettingFigures& chosen = FiguresOf(choice);
  std::vector<std::string> report = {absl::StrFormat(
      "chose %s %s for %s, %s light: %s, error %s, %d coefficients a look-up", CodecOf(choice),
      SettingOf(choice).label, GoalText(goal_), std::string(SceneLightName(goal_.light)),
      BytesText(chosen.bytes), ErrorsText(chosen), chosen.coefficients_read)};
  nlohmann::json rejected = nlohmann::json::array();
  for (const Rejection& rejection : Rejections(choice)) {
    const LadderSearch& search = searches_[rejection.ladder];
    std::string name = search.ladder().codec;
    nlohmann::json entry = {{"codec", name}};
    if (rejection.rung) {
      const Setting& setting = search.ladder().rungs[*rejection.rung];
      name += " " + setting.label;
      entry = JsonOf(search.ladder().codec, setting, search.measured().at(*rejection.rung));
    }
    rejected.push_back(std::move(entry));
    report.push_back(absl::StrCat("rejected ", name, ": ", rejection.why));
  }
  nlohmann::json goal = {{"scene_light", std::string(SceneLightName(goal_.light))}};
  if (goal_.max_bytes > 0) {
    goal["max_bytes"] = goal_.max_bytes;
  } else {
    goal["max_error"] = goal_.max_error;
  }
  return {
      {"goal", std::move(goal)},
      {"metric", "root mean square error of linear RGB, absolute; the worse of held-out lights and views"},
      {"chosen", JsonOf(CodecOf(choice), SettingOf(choice), chosen)},
      {"rejected", std::move(rejected)},
      {"report", std::move(report)}};
}

}  // namespace tessera
