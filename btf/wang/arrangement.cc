#include "btf/wang/arrangement.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"

namespace tessera {
namespace {

constexpr int kNumSides = 4;

// Every way to colour four sides, each with one of `num_colours` and the signs given.
std::vector<uint32_t> CodesOfSigns(const std::array<Sign, kNumSides>& signs, int num_colours) {
  std::vector<uint32_t> codes;
  const int num_colourings = num_colours * num_colours * num_colours * num_colours;
  for (int colouring = 0; colouring < num_colourings; ++colouring) {
    TileSides sides;
    int rest = colouring;
    for (int k = 0; k < kNumSides; ++k) {
      sides[k] = {rest % num_colours, signs[k]};
      rest /= num_colours;
    }
    codes.push_back(TileCode(sides, num_colours));
  }
  return codes;
}

Arrangement Finish(std::string id, std::vector<uint32_t> codes, int num_colours, bool turned_strips) {
  std::ranges::sort(codes);
  Arrangement arrangement{.id = std::move(id),
                          .codes = std::move(codes),
                          .num_colours = num_colours,
                          .turned_strips = turned_strips,
                          .sha256 = {}};
  const std::string listing = ArrangementListing(arrangement);
  arrangement.sha256 = Sha256Hex(std::as_bytes(std::span(listing)));
  return arrangement;
}

// South '+' and north '-' from the horizontal colours, east '+' and west '-' from the vertical ones.
Arrangement MakePlane(std::string id, int num_colours) {
  return Finish(std::move(id),
                CodesOfSigns({Sign::kPlus, Sign::kPlus, Sign::kMinus, Sign::kMinus}, num_colours),
                num_colours, false);
}

// Every code with two '+' and two '-' sides: 6 patterns x num_colours^4.
std::vector<uint32_t> SurfaceCodes(int num_colours) {
  std::vector<uint32_t> codes;
  std::array<Sign, kNumSides> signs = {Sign::kPlus, Sign::kPlus, Sign::kMinus, Sign::kMinus};
  do {
    const std::vector<uint32_t> more = CodesOfSigns(signs, num_colours);
    codes.insert(codes.end(), more.begin(), more.end());
  } while (std::ranges::next_permutation(signs).found);
  return codes;
}

// The smallest code of each orbit under quarter turns.
std::vector<uint32_t> SmallestOfTurned(const std::vector<uint32_t>& codes, int num_colours) {
  std::vector<uint32_t> smallest;
  std::ranges::copy_if(codes, std::back_inserter(smallest), [&](uint32_t code) {
    const TileSides sides = SidesFromTileCode(code, num_colours);
    return std::ranges::all_of(std::array{1, 2, 3}, [&](int first) {
      return code <= TileCode(SidesCountedFrom(sides, first), num_colours);
    });
  });
  return smallest;
}

}  // namespace

uint32_t TileCode(const TileSides& sides, int num_colours) {
  uint32_t code = 0;
  for (int k = kNumSides - 1; k >= 0; --k) {
    const int digit = sides[k].colour + (sides[k].sign == Sign::kMinus ? num_colours : 0);
    code = code * static_cast<uint32_t>(2 * num_colours) + static_cast<uint32_t>(digit);
  }
  return code;
}

TileSides SidesFromTileCode(uint32_t code, int num_colours) {
  TileSides sides;
  const auto base = static_cast<uint32_t>(2 * num_colours);
  for (TileSide& side : sides) {
    const int digit = static_cast<int>(code % base);
    side = {digit % num_colours, digit >= num_colours ? Sign::kMinus : Sign::kPlus};
    code /= base;
  }
  return sides;
}

TileSides SidesCountedFrom(const TileSides& sides, int first) {
  TileSides counted;
  for (int j = 0; j < kNumSides; ++j) {
    counted[j] = sides[(j + first) & 3];
  }
  return counted;
}

int Arrangement::IndexOfCode(uint32_t code) const {
  const auto it = std::lower_bound(codes.begin(), codes.end(), code);
  return it != codes.end() && *it == code ? static_cast<int>(it - codes.begin()) : -1;
}

TileSides Arrangement::SidesOf(size_t tile) const {
  return SidesFromTileCode(codes[tile], num_colours);
}

Arrangement::Laid Arrangement::TileShowing(const TileSides& sides) const {
  for (int turns = 0; turns < kNumSides; ++turns) {
    const int tile = IndexOfCode(TileCode(SidesCountedFrom(sides, turns), num_colours));
    if (tile >= 0) {
      return {tile, turns};
    }
  }
  return {};
}

std::string ArrangementListing(const Arrangement& arrangement) {
  std::string listing = absl::StrCat(arrangement.id, "\n");
  for (const uint32_t code : arrangement.codes) {
    absl::StrAppend(&listing, code, "\n");
  }
  return listing;
}

const std::vector<Arrangement>& BuiltinArrangements() {
  static const auto* const arrangements =
      new std::vector<Arrangement>{MakePlane("plane-16", 2), MakePlane("plane-81", 3),
                                   Finish("surface-26", SmallestOfTurned(SurfaceCodes(2), 2), 2, true),
                                   Finish("surface-96", SurfaceCodes(2), 2, true)};
  return *arrangements;
}

absl::StatusOr<const Arrangement*> FindArrangement(std::string_view id) {
  std::string known;
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    if (arrangement.id == id) {
      return &arrangement;
    }
    absl::StrAppend(&known, known.empty() ? "" : ", ", arrangement.id);
  }
  return absl::NotFoundError(absl::StrCat("no arrangement named '", std::string(id), "'; known: ", known));
}

}  // namespace tessera
