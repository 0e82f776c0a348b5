#include "btf/tiles/siblings.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "btf/tiles/tile_sides.h"

namespace tessera {
namespace {

// Share of a window, or of an inside: patches that stay below it make no two insides look alike, and those
// that continue a frame shared with a sibling still fit.
constexpr double kMostRepeated = 0.15;

}  // namespace

Siblings::Siblings(std::span<const uint32_t> texels, int size, int margin, int self, std::vector<int> turns)
    : texels_(texels), size_(size), margin_(margin), self_(self), turns_(std::move(turns)) {}

bool Siblings::Repeats(const Exemplar& exemplar, const Window& window, const Patch& patch,
                       const PatchCut& cut) const {
  const int first_x = std::max(window.x, margin_);
  const int first_y = std::max(window.y, margin_);
  const int end_x = std::min(window.x + window.width, size_ - margin_);
  const int end_y = std::min(window.y + window.height, size_ - margin_);
  std::vector<Shown> brought;
  for (int y = first_y; y < end_y; ++y) {
    for (int x = first_x; x < end_x; ++x) {
      const size_t in_window = static_cast<size_t>(y - window.y) * window.width + (x - window.x);
      if (cut.takes_new[in_window] != 0) {
        brought.push_back(
            {x, y, exemplar.TexelAt(patch.turn, patch.u + x - window.x, patch.v + y - window.y)});
      }
    }
  }
  return AnyShows(brought, kMostRepeated * window.width * window.height);
}

bool Siblings::Repeats(std::span<const uint32_t> tile) const {
  std::vector<Shown> inside;
  for (int y = margin_; y < size_ - margin_; ++y) {
    for (int x = margin_; x < size_ - margin_; ++x) {
      inside.push_back({x, y, tile[static_cast<size_t>(y) * size_ + x]});
    }
  }
  return AnyShows(inside, kMostRepeated * static_cast<double>(inside.size()));
}

// Whether one sibling shows more than `limit` of the texels.
bool Siblings::AnyShows(const std::vector<Shown>& texels, double limit) const {
  if (static_cast<double>(texels.size()) <= limit) {
    return false;
  }
  const size_t tile_area = static_cast<size_t>(size_) * size_;
  const int num_tiles = static_cast<int>(texels_.size() / tile_area);
  std::vector<std::pair<size_t, uint32_t>> wanted;  // index in a sibling, texel there
  for (const int turns : turns_) {
    wanted.clear();
    for (const Shown& at : texels) {
      const auto [x, y] = TilePixelBeforeTurns(at.x, at.y, turns, size_);
      wanted.emplace_back(static_cast<size_t>(y) * size_ + x, TurnTexel(at.texel, 4 - turns));
    }
    for (int tile = 0; tile < num_tiles; ++tile) {
      const auto sibling = texels_.subspan(tile * tile_area, tile_area);
      const auto num_repeated =
          std::ranges::count_if(wanted, [&](const auto& at) { return sibling[at.first] == at.second; });
      if (tile != self_ && static_cast<double>(num_repeated) > limit) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace tessera
