#include "btf/wang/arrangement.h"

#include <algorithm>
#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"

namespace tessera {
namespace {

constexpr int kNumSides = 4;
constexpr uint32_t kNumCodes = 256;  // 2 bits a side

Arrangement Finish(std::string id, std::vector<uint32_t> codes, bool turned_strips) {
  std::sort(codes.begin(), codes.end());
  Arrangement arrangement{
      .id = std::move(id), .codes = std::move(codes), .turned_strips = turned_strips, .sha256 = {}};
  const std::string listing = ArrangementListing(arrangement);
  arrangement.sha256 = Sha256Hex(std::as_bytes(std::span(listing)));
  return arrangement;
}

// South '+' and north '-' from two horizontal colours, east '+' and west '-' from two vertical ones.
Arrangement MakePlane16() {
  std::vector<uint32_t> codes;
  for (int bits = 0; bits < 16; ++bits) {
    codes.push_back(
        TileCode({TileSide{bits & 1, Sign::kPlus}, TileSide{(bits >> 1) & 1, Sign::kPlus},
                  TileSide{(bits >> 2) & 1, Sign::kMinus}, TileSide{(bits >> 3) & 1, Sign::kMinus}}));
  }
  return Finish("plane-16", std::move(codes), false);
}

// Every code with two '+' and two '-' sides: 6 patterns x 2^4 colours.
Arrangement MakeSurface96() {
  std::vector<uint32_t> codes;
  for (uint32_t code = 0; code < kNumCodes; ++code) {
    const TileSides sides = SidesFromTileCode(code);
    if (std::count_if(sides.begin(), sides.end(),
                      [](const TileSide& side) { return side.sign == Sign::kMinus; }) == 2) {
      codes.push_back(code);
    }
  }
  return Finish("surface-96", std::move(codes), true);
}

}  // namespace

uint32_t TileCode(const TileSides& sides) {
  uint32_t code = 0;
  for (int k = 0; k < kNumSides; ++k) {
    const uint32_t digit = static_cast<uint32_t>(sides[k].colour) + (sides[k].sign == Sign::kMinus ? 2u : 0u);
    code |= digit << (2 * k);
  }
  return code;
}

TileSides SidesFromTileCode(uint32_t code) {
  TileSides sides;
  for (int k = 0; k < kNumSides; ++k) {
    const uint32_t digit = (code >> (2 * k)) & 3u;
    sides[k] = {static_cast<int>(digit & 1u), (digit & 2u) != 0 ? Sign::kMinus : Sign::kPlus};
  }
  return sides;
}

int Arrangement::IndexOfCode(uint32_t code) const {
  const auto it = std::lower_bound(codes.begin(), codes.end(), code);
  return it != codes.end() && *it == code ? static_cast<int>(it - codes.begin()) : -1;
}

std::string ArrangementListing(const Arrangement& arrangement) {
  std::string listing = absl::StrCat(arrangement.id, "\n");
  for (const uint32_t code : arrangement.codes) {
    absl::StrAppend(&listing, code, "\n");
  }
  return listing;
}

const std::vector<Arrangement>& BuiltinArrangements() {
  static const auto* const arrangements = new std::vector<Arrangement>{MakePlane16(), MakeSurface96()};
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
