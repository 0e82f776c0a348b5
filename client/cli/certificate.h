// What a tile set's certificate gives reason to warn of.
#pragma once

#include <string>
#include <vector>

#include "client/cli/session.h"

namespace tessera::cli {

// Seams whose ratio is above this are worth a look: along a cut, texels then differ half as much again as
// neighbours in the material itself do (ratio 1: the cut cannot be told from the material).
inline constexpr double kSeamRatioLimit = 1.5;

// One sentence per part of the certificate (borders, insides) whose pooled ratio is above the limit.
[[nodiscard]] std::vector<std::string> CertificateWarnings(const Json& certificate);

}  // namespace tessera::cli
