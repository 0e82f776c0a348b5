// What a tile set's certificate gives reason to warn of.
#pragma once

#include <string>
#include <vector>

#include "client/cli/session.h"

namespace tessera::cli {

// One sentence per part of the certificate (borders, insides) whose seam ratio is above the limit that the
// certificate states. Empty for a certificate that states none.
[[nodiscard]] std::vector<std::string> CertificateWarnings(const Json& certificate);

}  // namespace tessera::cli
