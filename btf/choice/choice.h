// Which model a BTF needs: the smallest and cheapest that meets a bound on directions held out of the
// encoder.
//
//   ModelChooser chooser({.max_error = 0.05}, ChoiceLadders(info, params), meter);
//   TESSERA_ASSIGN_OR_RETURN(const ModelChoice choice, chooser.Choose());
//
// The rule. Errors are root mean squares over linear RGB, absolute; the error of a model is the worse of two:
// at held-out lights, encoded without every fifth light, and at held-out views, likewise (data/subset_btf.h).
//
// - max_error: of each codec the smallest setting whose error is at most max_error.
// - max_bytes: of each codec the smallest setting that fits and whose error is at most kEqualErrors times the
//   lowest among all that fit (kEnvironment: among those that project on spherical harmonics, if one fits):
//   what is no more accurate is not larger.
// - Of these, kEnvironment: those that project on spherical harmonics, if there is one; those of at most
//   kEqualBytes times the bytes of the smallest; the one that reads the fewest coefficients of a texel for
//   one light and view; then the most accurate; then the first in ChoiceLadders' order.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/choice/encode_model.h"
#include "btf/choice/ladder.h"
#include "btf/choice/ladder_search.h"

namespace tessera {

inline constexpr double kEqualErrors = 1.01;
inline constexpr double kEqualBytes = 1.05;

// Exactly one of the bounds is set.
struct ModelGoal {
  double max_error = 0.0;
  uint64_t max_bytes = 0;
  SceneLight light = SceneLight::kPoint;
};

struct ModelChoice {
  size_t ladder = 0;  // index into the chooser's
  size_t rung = 0;
};

// Not thread-safe.
class ModelChooser {
 public:
  // What measures a setting of a codec. Errors: as LadderSearch::Meter's.
  using Meter = std::function<absl::StatusOr<SettingFigures>(const std::string& codec, const Setting&)>;

  ModelChooser(const ModelGoal& goal, std::vector<Ladder> ladders, const Meter& meter);

  // The rule above, on the figures as they are now. Errors: FAILED_PRECONDITION with reason BOUND_NOT_REACHED
  // naming the best figure reached and its setting; the first codec's refusal when all refuse; the meter's.
  [[nodiscard]] absl::StatusOr<ModelChoice> Choose();
  // Puts better figures in the place of a setting's.
  void Correct(const ModelChoice& choice, const SettingFigures& figures);

  [[nodiscard]] const std::string& CodecOf(const ModelChoice& choice) const;
  [[nodiscard]] const Setting& SettingOf(const ModelChoice& choice) const;
  [[nodiscard]] const SettingFigures& FiguresOf(const ModelChoice& choice) const;

  // For metadata["choice"]: `goal`, `metric`, the figures of the `chosen` setting and, for each codec, of the
  // `rejected` one that came closest (of the chosen codec the next smaller), and `report`: the same in
  // sentences, with by how much.
  [[nodiscard]] nlohmann::json Record(const ModelChoice& choice) const;

 private:
  // By the scene's light.
  [[nodiscard]] bool IsPreferred(const Ladder& ladder) const;
  [[nodiscard]] absl::StatusOr<ModelBound> BoundOfGoal();
  [[nodiscard]] absl::Status NotReached() const;

  struct Rejection {
    size_t ladder = 0;
    std::optional<size_t> rung;  // none where nothing was measured
    std::string why;
  };
  [[nodiscard]] std::vector<Rejection> Rejections(const ModelChoice& choice) const;

  ModelGoal goal_;
  ModelBound bound_;  // of the last Choose
  std::vector<LadderSearch> searches_;
};

}  // namespace tessera
