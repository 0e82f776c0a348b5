// Canonical arrangements: the list of tiles by edge code, independent of material and resolution.
//
//                 side 2 (north)         A side is (colour, sign). With n colours, tile code = sum over sides
//                 k
//               +----------------+         of (colour_k + n [sign_k is '-']) (2 n)^k. Tiles are listed in
//               |                |         ascending code. Ids are permanent: a changed list gets a new id.
//   side 3      |                |         Sign '+': the strip runs along the tile's counter-clockwise
//   (west)      |                | side 1  boundary and the tile takes the strip's upper half; '-': against
//               |                | (east)  it, and the lower half. Two tiles fit across an edge when their
//               +----------------+         sides have one colour and opposite signs.
//                 side 0 (south)
//
//   TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement("surface-96"));
//   TileSides sides = arrangement->SidesOf(tile);
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
  int colour = 0;  // from 0, below the arrangement's num_colours
  Sign sign = Sign::kPlus;
  friend bool operator==(const TileSide&, const TileSide&) = default;
};

using TileSides = std::array<TileSide, 4>;  // south, east, north, west

// With 1 to kMostColours colours, so that codes fit 32 bits.
inline constexpr int kMostColours = 127;
[[nodiscard]] uint32_t TileCode(const TileSides& sides, int num_colours);
[[nodiscard]] TileSides SidesFromTileCode(uint32_t code, int num_colours);

// `sides` counted from side `first`: the sides of a tile that, laid with `first` quarter turns, shows `sides`
// (dressing.h).
[[nodiscard]] TileSides SidesCountedFrom(const TileSides& sides, int first);

struct Arrangement {
  std::string id;               // "plane-16", "surface-96"
  std::vector<uint32_t> codes;  // ascending
  int num_colours = 2;          // of horizontal sides and of vertical ones, or of all sides
  // true: side k shows its strip turned by k quarter turns (plus a half turn for '-'), all sides draw from
  // one pool of strips. false: no turns; horizontal (south, north) and vertical (east, west) sides have their
  // own colours.
  bool turned_strips = false;
  std::string sha256;  // of the canonical listing, see ArrangementListing

  // Index of the tile with this code, -1 if there is none.
  [[nodiscard]] int IndexOfCode(uint32_t code) const;
  // The sides of codes[tile].
  [[nodiscard]] TileSides SidesOf(size_t tile) const;
  // Index and the smallest number of quarter turns of a tile that shows `sides` when laid with them; -1 if
  // there is none.
  struct Laid {
    int tile = -1;
    int turns = 0;
  };
  [[nodiscard]] Laid TileShowing(const TileSides& sides) const;
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
