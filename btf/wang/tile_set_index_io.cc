#include "btf/wang/tile_set_index_io.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/range_coder.h"
#include "btf/wang/tile_set_parts_layout.h"

namespace tessera {
namespace {

constexpr char kPatches[] = "tile_patches";
constexpr size_t kMostNeighbours = 4;
constexpr size_t kMostRecent = 256;
constexpr int kTexelBits = 32;

// One tile's patches while its texels are written or read, row by row.
class PatchTile {
 public:
  PatchTile(int tile_size, const SourceGrid& grid)
      : width_(static_cast<size_t>(tile_size)),
        step_(static_cast<uint32_t>(grid.footprint)),
        row_step_(static_cast<uint32_t>(grid.footprint) * static_cast<uint32_t>(grid.width)) {}

  // Labels are modulo 2^30.
  [[nodiscard]] uint32_t PatchOf(uint32_t texel) const {
    const int turns = TurnsOfTexel(texel);
    return PackTexel((BtfelOfTexel(texel) - WayTo(turns)) & kLargestPackedBtfel, turns);
  }
  [[nodiscard]] uint32_t TexelOf(uint32_t patch) const {
    const int turns = TurnsOfTexel(patch);
    return PackTexel((BtfelOfTexel(patch) + WayTo(turns)) & kLargestPackedBtfel, turns);
  }

  // The patches of the texels to the left, above, above right and above left of the next one, each once.
  [[nodiscard]] std::span<const uint32_t> FindNeighbours() {
    num_neighbours_ = 0;
    for (const auto& [left, up] : kWays) {
      const std::optional<uint32_t> patch = PatchBefore(left, up);
      const auto end = neighbours_.begin() + static_cast<ptrdiff_t>(num_neighbours_);
      if (patch.has_value() && std::find(neighbours_.begin(), end, *patch) == end) {
        neighbours_[num_neighbours_++] = *patch;
      }
    }
    return std::span(neighbours_).first(num_neighbours_);
  }

  // Which of the texels around the next one are of one patch: the lines that patches end at go on.
  [[nodiscard]] size_t ContextOf() const {
    const auto alike = [&](int left, int up, int other_left, int other_up) {
      const std::optional<uint32_t> patch = PatchBefore(left, up);
      return patch.has_value() && patch == PatchBefore(other_left, other_up);
    };
    return static_cast<size_t>(alike(1, 0, 0, 1)) | static_cast<size_t>(alike(1, 0, 1, 1)) << 1 |
           static_cast<size_t>(alike(0, 1, 1, 1)) << 2 | static_cast<size_t>(alike(0, 1, -1, 1)) << 3 |
           static_cast<size_t>(alike(1, 0, 2, 0)) << 4 | static_cast<size_t>(alike(0, 1, 0, 2)) << 5 |
           static_cast<size_t>(alike(1, 1, -1, 1)) << 6;
  }

  // Of the patches in the order of their latest use, at most kMostRecent - 1; nothing where it is further or
  // new.
  [[nodiscard]] std::optional<size_t> RankOf(uint32_t patch) const {
    for (size_t rank = 0; rank < std::min(recent_.size(), kMostRecent); ++rank) {
      if (recent_[recent_.size() - 1 - rank] == patch) {
        return rank;
      }
    }
    return std::nullopt;
  }
  [[nodiscard]] std::optional<uint32_t> Recent(int32_t rank) const {
    return rank >= 0 && std::cmp_less(rank, recent_.size())
               ? std::optional(recent_[recent_.size() - 1 - static_cast<size_t>(rank)])
               : std::nullopt;
  }

  void Add(uint32_t patch) {
    if (const std::optional<size_t> rank = RankOf(patch)) {
      recent_.erase(recent_.end() - 1 - static_cast<ptrdiff_t>(*rank));
    }
    recent_.push_back(patch);
    patches_.push_back(patch);
  }

 private:
  static constexpr std::array<std::pair<int, int>, kMostNeighbours> kWays = {
      {{1, 0}, {0, 1}, {-1, 1}, {1, 1}}};

  // Of the texel so far to the left of the next one, and above.
  [[nodiscard]] std::optional<uint32_t> PatchBefore(int left, int up) const {
    const auto width = static_cast<int>(width_);
    const int x = static_cast<int>(patches_.size() % width_) - left;
    const int y = static_cast<int>(patches_.size() / width_) - up;
    return x >= 0 && x < width && y >= 0 ? std::optional(patches_[static_cast<size_t>(y) * width_ + x])
                                         : std::nullopt;
  }

  // From the label at (0, 0) to that of the next texel.
  [[nodiscard]] uint32_t WayTo(int turns) const {
    const auto x = static_cast<uint32_t>(patches_.size() % width_);
    const auto y = static_cast<uint32_t>(patches_.size() / width_);
    switch (turns) {
      case 0:
        return x * step_ + y * row_step_;
      case 1:
        return x * row_step_ - y * step_;
      case 2:
        return 0U - x * step_ - y * row_step_;
      default:
        return y * step_ - x * row_step_;
    }
  }

  size_t width_;
  uint32_t step_;
  uint32_t row_step_;
  std::vector<uint32_t> patches_;  // row by row
  std::vector<uint32_t> recent_;   // the latest last
  std::array<uint32_t, kMostNeighbours> neighbours_ = {};
  size_t num_neighbours_ = 0;
};

// What says of which patch a texel is.
struct PatchContexts {
  // Whether it is not the first of the neighbours' patches, not the second, ..
  std::array<std::array<AdaptiveBit, kMostNeighbours>, 128> neighbour;
  AdaptiveBit is_new;
  AdaptiveNumber rank;
  std::array<AdaptiveBit, kTexelBits> texel;  // of a new patch, from the highest bit
};

}  // namespace

void AddIndexSections(std::span<const uint32_t> texels, int tile_size, const SourceGrid& grid,
                      Container& container) {
  const size_t per_tile = static_cast<size_t>(tile_size) * static_cast<size_t>(tile_size);
  RangeWriter writer;
  PatchContexts contexts;
  for (size_t begin = 0; begin < texels.size(); begin += per_tile) {
    PatchTile tile(tile_size, grid);
    for (const uint32_t texel : texels.subspan(begin, per_tile)) {
      const uint32_t patch = tile.PatchOf(texel);
      auto& bits = contexts.neighbour[tile.ContextOf()];
      const std::span<const uint32_t> neighbours = tile.FindNeighbours();
      const auto found = static_cast<size_t>(std::ranges::find(neighbours, patch) - neighbours.begin());
      for (size_t i = 0; i < std::min(found + 1, neighbours.size()); ++i) {
        writer.Write(i < found, bits[i]);
      }
      if (found == neighbours.size()) {
        const std::optional<size_t> rank = tile.RankOf(patch);
        writer.Write(!rank.has_value(), contexts.is_new);
        if (rank.has_value()) {
          contexts.rank.Write(static_cast<int32_t>(*rank), writer);
        } else {
          for (int bit = kTexelBits - 1; bit >= 0; --bit) {
            writer.Write((texel >> bit & 1U) != 0, contexts.texel[static_cast<size_t>(bit)]);
          }
        }
      }
      tile.Add(patch);
    }
  }
  AddVector(kPatches, std::move(writer).Finish(), container);
}

absl::StatusOr<std::vector<uint32_t>> ReadIndexSections(const Container& container, size_t num_tiles,
                                                        int tile_size, const SourceGrid& grid) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, ReadVector<uint8_t>(container, kPatches));
  const size_t per_tile = static_cast<size_t>(tile_size) * static_cast<size_t>(tile_size);
  RangeReader reader(bytes);
  PatchContexts contexts;
  std::vector<uint32_t> texels;
  texels.reserve(num_tiles * per_tile);
  for (size_t i = 0; i < num_tiles; ++i) {
    PatchTile tile(tile_size, grid);
    for (size_t j = 0; j < per_tile; ++j) {
      auto& bits = contexts.neighbour[tile.ContextOf()];
      const std::span<const uint32_t> neighbours = tile.FindNeighbours();
      size_t found = 0;
      while (found < neighbours.size() && reader.Read(bits[found])) {
        ++found;
      }
      std::optional<uint32_t> patch;
      if (found < neighbours.size()) {
        patch = neighbours[found];
      } else if (reader.Read(contexts.is_new)) {
        uint32_t texel = 0;
        for (int bit = kTexelBits - 1; bit >= 0; --bit) {
          texel |= static_cast<uint32_t>(reader.Read(contexts.texel[static_cast<size_t>(bit)])) << bit;
        }
        patch = tile.PatchOf(texel);
      } else {
        patch = tile.Recent(contexts.rank.Read(reader));
      }
      if (!patch.has_value()) {
        return absl::InvalidArgumentError(absl::StrCat("section '", kPatches, "': tile ", i, ", texel ", j,
                                                       " is of no patch that is there"));
      }
      texels.push_back(tile.TexelOf(*patch));
      tile.Add(*patch);
    }
  }
  if (const absl::Status status = reader.CheckEnd(); !status.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("section '", kPatches, "': ", status.message()));
  }
  return texels;
}

}  // namespace tessera
