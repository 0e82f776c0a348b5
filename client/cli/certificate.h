// A tile set's certificate in words, and what it gives reason to warn of.
#pragma once

#include <string>
#include <vector>

#include "client/cli/session.h"

namespace tessera::cli {

// Seams whose ratio is above this are worth a look: along a cut, texels then differ half as much again as
// neighbours in the material itself do (ratio 1: the cut cannot be told from the material).
inline constexpr double kSeamRatioLimit = 1.5;

// Planes of tiles in which a regular material's period keeps less than this of its autocorrelation are out of
// step: generated weave keeps 0.98 where tiles are in step and 0.38 where they are half a period off.
inline constexpr double kPeriodKeptLimit = 0.8;

// Planes of tiles that repeat by more than this times the material's own autocorrelation repeat more than
// need be: turned strips in tiles of 96 texels keep every measured isotropic material below it.
inline constexpr double kRepetitionLimit = 1.2;

// A table of seams beside what random cuts score, and lines on repetition and use of the material. Figures
// that are missing are left out.
[[nodiscard]] std::string CertificateText(const Json& certificate);

// One sentence per part of the certificate (borders, insides) whose pooled ratio is above the limit, one
// where the period is not kept, and one where the plane of tiles repeats.
[[nodiscard]] std::vector<std::string> CertificateWarnings(const Json& certificate);

}  // namespace tessera::cli
