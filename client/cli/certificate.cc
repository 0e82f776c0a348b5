#include "client/cli/certificate.h"

#include <array>
#include <optional>

#include <fmt/format.h>

#include "client/cli/describe.h"

namespace tessera::cli {
namespace {

constexpr std::array<const char*, 2> kParts = {"borders", "insides"};

// The number at a path of keys, if there is one.
std::optional<double> Number(const Json& certificate, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  return certificate.contains(at) && certificate.at(at).is_number()
             ? std::optional(certificate.at(at).get<double>())
             : std::nullopt;
}

// The same as text, empty where there is none.
std::string Figure(const Json& certificate, const std::string& pointer, const char* format = "{:.3f}") {
  const std::optional<double> number = Number(certificate, pointer);
  return number ? fmt::format(fmt::runtime(format), *number) : std::string();
}

}  // namespace

std::string CertificateText(const Json& certificate) {
  std::vector<std::vector<std::string>> table = {{"SEAMS", "RATIO", "P95", "WORST", "RUNS P95", "CUT %"}};
  for (const std::string part : kParts) {
    const auto figure = [&](const char* key) {
      return Figure(certificate, fmt::format("/{}/{}", part, key));
    };
    const std::optional<double> cut = Number(certificate, "/" + part + "/cut_share");
    table.push_back({part, figure("ratio"), figure("ratio_p95"), figure("ratio_worst"),
                     figure("ratio_run_p95"), cut ? fmt::format("{:.1f}", 100.0 * *cut) : std::string()});
  }
  table.push_back({"random minimum cuts", Figure(certificate, "/controls/random_minimum_cuts")});
  table.push_back({"random straight cuts", Figure(certificate, "/controls/random_straight_cuts")});
  table.push_back({"false cuts", Figure(certificate, "/controls/false_cuts")});
  for (std::vector<std::string>& row : table) {
    row.resize(table.front().size());
  }
  std::string text = TextTable(table);
  const std::string images = Figure(certificate, "/images/count", "{:.0f}");
  if (!images.empty()) {
    text += fmt::format("\nin {} of {} images", images, Figure(certificate, "/images/of", "{:.0f}"));
  }
  const std::string repetition = Figure(certificate, "/repetition/ratio", "{:.2f}");
  if (!repetition.empty()) {
    text += fmt::format("\nrepetition {} times the material's (autocorrelation {} and {})", repetition,
                        Figure(certificate, "/repetition/plane_peak", "{:.2f}"),
                        Figure(certificate, "/repetition/exemplar_peak", "{:.2f}"));
  }
  const std::string kept = Figure(certificate, "/repetition/period/kept", "{:.2f}");
  if (!kept.empty()) {
    text += fmt::format("\nperiod kept {} times as well as in the material (autocorrelation {} and {})", kept,
                        Figure(certificate, "/repetition/period/plane", "{:.2f}"),
                        Figure(certificate, "/repetition/period/exemplar", "{:.2f}"));
  }
  return text;
}

std::vector<std::string> CertificateWarnings(const Json& certificate) {
  std::vector<std::string> warnings;
  for (const char* const part : kParts) {
    if (const auto ratio = Number(certificate, fmt::format("/{}/ratio", part));
        ratio && *ratio > kSeamRatioLimit) {
      warnings.push_back(
          fmt::format("seams of the {} read {:.2f}, above the limit of {:.2f}: look at `tileset sheet "
                      "--heat`, raise --effort",
                      part, *ratio, kSeamRatioLimit));
    }
  }
  if (const auto kept = Number(certificate, "/repetition/period/kept"); kept && *kept < kPeriodKeptLimit) {
    warnings.push_back(fmt::format(
        "the material's period is lost: a plane of tiles keeps {:.2f} of it, below the limit of {:.2f}",
        *kept, kPeriodKeptLimit));
  }
  if (const auto ratio = Number(certificate, "/repetition/ratio"); ratio && *ratio > kRepetitionLimit) {
    warnings.push_back(fmt::format(
        "a plane of tiles repeats {:.2f} times as much as the material, above the limit of {:.2f}: "
        "larger tiles repeat less, and so do turned ones (surface-26)",
        *ratio, kRepetitionLimit));
  }
  return warnings;
}

}  // namespace tessera::cli
