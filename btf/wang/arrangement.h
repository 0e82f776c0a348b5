// Canonical arrangements: the list of tiles by edge code, independent of material and resolution.
//
//                 side 2 (north)         A side is (colour, sign). Tile code = sum over sides k of
//               +----------------+         (colour_k + 2 [sign_k is '-']) * 4^k. Tiles are listed in
//               |                |         ascending code. Ids are permanent: a changed list gets a new id.
//   side 3      |                |         Sign '+': the strip runs along the tile's counter-clockwise
//   (west)      |                | side 1  boundary and the tile takes the strip's upper half; '-': against
//               |                | (east)  it, and the lower half. Two tiles fit across an edge when their
//               +----------------+         sides have one colour and opposite signs.
//                 side 0 (south)
//
//   TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement("surface-96"));
//   TileSides sides = SidesFromTileCode(arrangement->codes[tile]);
//
// Sources: [Leung2007] 3.2 and 4.1 (96 tiles for closed surfaces), [Fu2005] (Euler circuits give the signs).
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

namespace tessera {

enum class Sign : uint8_t { kPlus = 0, kMinus = 1 };

struct TileSide {
  int colour = 0;  // 0 or 1
  Sign sign = Sign::kPlus;
  friend bool operator==(const TileSide&, const TileSide&) = default;
};

using TileSides = std::array<TileSide, 4>;  // south, east, north, west

[[nodiscard]] uint32_t TileCode(const TileSides& sides);
[[nodiscard]] TileSides SidesFromTileCode(uint32_t code);

struct Arrangement {
  std::string id;               // "plane-16", "surface-96"
  std::vector<uint32_t> codes;  // ascending
  // true: side k shows its strip turned by k quarter turns (plus a half turn for '-'), all sides draw from
  // one pool of strips. false: no turns; horizontal (south, north) and vertical (east, west) sides have their
  // own colours.
  bool turned_strips = false;
  std::string sha256;  // of the canonical listing, see ArrangementListing

  // Index of the tile with this code, -1 if there is none.
  [[nodiscard]] int IndexOfCode(uint32_t code) const;
};

// True when tile sides `a` and `b` may meet across an edge: one colour, opposite signs.
[[nodiscard]] constexpr bool SidesMatch(const TileSide& a, const TileSide& b) {
  return a.colour == b.colour && a.sign != b.sign;
}

// The text whose SHA-256 identifies an arrangement: the id, then one code a line, decimal, each line ended by
// '\n'.
[[nodiscard]] std::string ArrangementListing(const Arrangement& arrangement);

// Every built-in arrangement, in order of id.
[[nodiscard]] const std::vector<Arrangement>& BuiltinArrangements();
// Errors: NOT_FOUND naming the id and the known ones.
[[nodiscard]] absl::StatusOr<const Arrangement*> FindArrangement(std::string_view id);

}  // namespace tessera
