#include "client/cli/certificate.h"

#include <fmt/format.h>

namespace tessera::cli {

std::vector<std::string> CertificateWarnings(const Json& certificate) {
  std::vector<std::string> warnings;
  const auto limit = certificate.find("limit");
  if (limit == certificate.end() || !limit->is_number()) {
    return warnings;
  }
  for (const auto& [part, figures] : certificate.items()) {
    const auto ratio = figures.is_object() ? figures.find("ratio") : figures.end();
    if (figures.is_object() && ratio != figures.end() && ratio->is_number() && *ratio > *limit) {
      warnings.push_back(
          fmt::format("seams of the {} read {:.2f}, above the limit of {:.2f}: look at `tileset sheet`", part,
                      ratio->get<double>(), limit->get<double>()));
    }
  }
  return warnings;
}

}  // namespace tessera::cli
