// What a certificate is compared with: seams whose score is known beforehand, and seams made without any
// search, so that it can be seen to fail.
#pragma once

#include <vector>

#include "btf/tiles/certificate.h"
#include "btf/tiles/exemplar.h"

namespace tessera {

// Straight lines drawn through the exemplar every `spacing` texels, called cuts although texels continue each
// other: they score exactly 1.
[[nodiscard]] Seams FalseCuts(const Exemplar& exemplar, int spacing);

struct RandomJoins {
  Seams minimum_cuts;
  Seams straight_cuts;
};

// Pairs of patches drawn at random, in any of `turns`, that overlap in a window `strip_height` wide and up to
// four times as high, joined down its middle: by the minimum cut, and straight. The same for one exemplar.
[[nodiscard]] RandomJoins JoinAtRandom(const Exemplar& exemplar, const std::vector<int>& turns,
                                       int strip_height);

}  // namespace tessera
