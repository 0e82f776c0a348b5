#include "btf/wang/edge_signs.h"

#include <bit>
#include <limits>

#include "btf/base/rng.h"

namespace tessera {
namespace {

constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
// Keeps the trails' choices independent of the colours, which hash the same keys.
constexpr uint64_t kTrailStream = 0x747261696c730000ULL;

// The side, as 4 face + side, at which a trail arrives when it leaves through each side.
std::vector<uint32_t> ArrivalOf(const QuadAdjacency& adjacency) {
  std::vector<uint32_t> arrival(adjacency.across.size() * 4, kNone);
  uint32_t waiting = kNone;  // a boundary side without a partner yet
  for (uint32_t side = 0; side < arrival.size(); ++side) {
    const QuadAdjacency::Across& across = adjacency.across[side / 4][side % 4];
    if (across.face >= 0) {
      arrival[side] = 4 * static_cast<uint32_t>(across.face) + static_cast<uint32_t>(across.side);
    } else if (waiting == kNone) {
      waiting = side;
    } else {
      arrival[side] = waiting;
      arrival[waiting] = side;
      waiting = kNone;
    }
  }
  return arrival;
}

}  // namespace

std::vector<std::array<Sign, 4>> EulerSigns(const QuadAdjacency& adjacency, uint64_t seed) {
  const std::vector<uint32_t> arrival = ArrivalOf(adjacency);
  std::vector<std::array<Sign, 4>> signs(adjacency.across.size());
  std::vector<uint8_t> unused(adjacency.across.size(), 0xf);  // bit k: side k has no sign yet
  const uint64_t stream = Mix64(seed, kTrailStream);

  const auto pick_unused = [&](uint32_t face, uint64_t key) {
    uint32_t skip =
        static_cast<uint32_t>(Mix64(stream, key) % static_cast<uint32_t>(std::popcount(unused[face])));
    for (uint32_t k = 0;; ++k) {
      if ((unused[face] >> k & 1) != 0 && skip-- == 0) {
        return 4 * face + k;
      }
    }
  };

  for (uint32_t start = 0; start < signs.size(); ++start) {
    while (unused[start] != 0) {
      // Every face has an even number of unused sides, so the trail can only end where it began.
      uint32_t face = start;
      uint64_t key = 4 * uint64_t{start} + static_cast<uint64_t>(std::countr_zero(unused[start]));
      while (unused[face] != 0) {
        const uint32_t leaving = pick_unused(face, key);
        signs[face][leaving % 4] = Sign::kPlus;
        unused[face] &= static_cast<uint8_t>(~(1u << (leaving % 4)));
        const uint32_t entered = arrival[leaving];
        face = entered / 4;
        signs[face][entered % 4] = Sign::kMinus;
        unused[face] &= static_cast<uint8_t>(~(1u << (entered % 4)));
        key = entered;
      }
    }
  }
  return signs;
}

int EdgeColour(uint64_t seed, uint32_t edge_key, int num_colours) {
  return static_cast<int>(Mix64(seed, edge_key) % static_cast<uint64_t>(num_colours));
}

}  // namespace tessera
