#include "client/cli/certificate.h"

#include <fmt/format.h>

namespace tessera::cli {

std::vector<std::string> CertificateWarnings(const Json& certificate) {
  std::vector<std::string> warnings;
  for (const auto& [part, figures] : certificate.items()) {
    if (!figures.is_object()) {
      continue;
    }
    const auto ratio = figures.find("ratio");
    if (ratio != figures.end() && ratio->is_number() && ratio->get<double>() > kSeamRatioLimit) {
      warnings.push_back(
          fmt::format("seams of the {} read {:.2f}, above the limit of {:.2f}: look at `tileset sheet`", part,
                      ratio->get<double>(), kSeamRatioLimit));
    }
  }
  return warnings;
}

}  // namespace tessera::cli
