#include "client/cli/certificate.h"

#include <array>

#include <fmt/format.h>

#include "client/cli/describe.h"

namespace tessera::cli {
namespace {

constexpr std::array<const char*, 2> kParts = {"borders", "insides"};

// The figure at a path of keys as text, empty where there is no such number.
std::string Figure(const Json& certificate, const char* pointer, const char* format = "{:.3f}") {
  const Json::json_pointer at(pointer);
  return certificate.contains(at) && certificate.at(at).is_number()
             ? fmt::format(fmt::runtime(format), certificate.at(at).get<double>())
             : std::string();
}

}  // namespace

std::string CertificateText(const Json& certificate) {
  std::vector<std::vector<std::string>> table = {{"SEAMS", "RATIO", "P95", "WORST", "RUNS P95", "CUT %"}};
  for (const std::string part : kParts) {
    const auto figure = [&](const char* key) {
      return Figure(certificate, fmt::format("/{}/{}", part, key).c_str());
    };
    const Json::json_pointer cut("/" + part + "/cut_share");
    table.push_back({part, figure("ratio"), figure("ratio_p95"), figure("ratio_worst"),
                     figure("ratio_run_p95"),
                     certificate.contains(cut) && certificate.at(cut).is_number()
                         ? fmt::format("{:.1f}", 100.0 * certificate.at(cut).get<double>())
                         : std::string()});
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
    const Json::json_pointer at(fmt::format("/{}/ratio", part));
    if (!certificate.contains(at) || !certificate.at(at).is_number()) {
      continue;
    }
    const auto ratio = certificate.at(at).get<double>();
    if (ratio > kSeamRatioLimit) {
      warnings.push_back(
          fmt::format("seams of the {} read {:.2f}, above the limit of {:.2f}: look at `tileset sheet "
                      "--heat`, raise --effort",
                      part, ratio, kSeamRatioLimit));
    }
  }
  const Json::json_pointer kept("/repetition/period/kept");
  if (certificate.contains(kept) && certificate.at(kept).is_number() &&
      certificate.at(kept).get<double>() < kPeriodKeptLimit) {
    warnings.push_back(fmt::format(
        "the material's period is lost: a plane of tiles keeps {:.2f} of it, below the limit of {:.2f}",
        certificate.at(kept).get<double>(), kPeriodKeptLimit));
  }
  return warnings;
}

}  // namespace tessera::cli
