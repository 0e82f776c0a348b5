#include "btf/tiles/border_cut.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/tiles/max_flow.h"

namespace tessera {
namespace {

// A grid in plain form, its terminals as stretches and as lists of nodes y * width + x.
struct BorderGrid {
  int width = 0;
  int height = 0;
  std::vector<std::array<int, 2>> right, down;  // there, back; by y * width + x
  BorderCut::Stretch source, sink;
  std::vector<int> source_nodes, sink_nodes;

  BorderGrid(int w, int h) : width(w), height(h), right(w * h, {0, 0}), down(w * h, {0, 0}) {}

  template <typename OnSourceSide>
  [[nodiscard]] int64_t CutValue(const OnSourceSide& on_source_side) const {
    int64_t value = 0;
    for (int i = 0; i < width * height; ++i) {
      const bool here = on_source_side(i);
      const auto edge = [&](const std::array<int, 2>& capacity, int j) {
        if (on_source_side(j) != here) {
          value += capacity[here ? 0 : 1];
        }
      };
      if (i % width + 1 < width) {
        edge(right[i], i + 1);
      }
      if (i / width + 1 < height) {
        edge(down[i], i + width);
      }
    }
    return value;
  }

  [[nodiscard]] int64_t BruteForce() const {
    uint32_t pinned_source = 0;
    uint32_t pinned_sink = 0;
    for (const int i : source_nodes) {
      pinned_source |= 1u << i;
    }
    for (const int i : sink_nodes) {
      pinned_sink |= 1u << i;
    }
    int64_t best = INT64_MAX;
    for (uint32_t side = 0; side < (1u << (width * height)); ++side) {
      if ((side & pinned_source) == pinned_source && (side & pinned_sink) == 0) {
        best = std::min(best, CutValue([&](int i) { return (side >> i & 1u) != 0; }));
      }
    }
    return best;
  }

  template <typename Cut>
  void SetEdges(Cut& cut) const {
    for (int i = 0; i < width * height; ++i) {
      const int x = i % width;
      const int y = i / width;
      // Half of the edges from either end.
      if (x + 1 < width && i % 2 == 0) {
        cut.SetEdge(x, y, GridCut::kRight, right[i][0], right[i][1]);
      } else if (x + 1 < width) {
        cut.SetEdge(x + 1, y, GridCut::kLeft, right[i][1], right[i][0]);
      }
      if (y + 1 < height && i % 2 == 0) {
        cut.SetEdge(x, y, GridCut::kDown, down[i][0], down[i][1]);
      } else if (y + 1 < height) {
        cut.SetEdge(x, y + 1, GridCut::kUp, down[i][1], down[i][0]);
      }
    }
  }

  int64_t Solve(BorderCut& cut) const {
    cut.Reset(width, height);
    cut.SetTerminals(source, sink);
    SetEdges(cut);
    return cut.Solve();
  }

  int64_t Solve(GridCut& cut) const {
    cut.Reset(width, height);
    SetEdges(cut);
    for (const int i : source_nodes) {
      cut.AddTerminals(i % width, i / width, GridCut::kPinned, 0);
    }
    for (const int i : sink_nodes) {
      cut.AddTerminals(i % width, i / width, 0, GridCut::kPinned);
    }
    return cut.Solve();
  }

  // The labels are a cut of `value` between the terminals.
  void ExpectCut(const BorderCut& cut, int64_t value) const {
    EXPECT_EQ(value, CutValue([&](int i) { return cut.OnSourceSide(i % width, i / width); }));
    for (const int i : source_nodes) {
      EXPECT_TRUE(cut.OnSourceSide(i % width, i / width)) << "node " << i;
    }
    for (const int i : sink_nodes) {
      EXPECT_FALSE(cut.OnSourceSide(i % width, i / width)) << "node " << i;
    }
  }
};

std::vector<int> RingNodes(int width, int height) {
  std::vector<int> ring;
  for (int x = 0; x < width; ++x) {
    ring.push_back(x);
  }
  for (int y = 1; y < height; ++y) {
    ring.push_back(y * width + width - 1);
  }
  for (int x = width - 2; x >= 0 && height > 1; --x) {
    ring.push_back((height - 1) * width + x);
  }
  for (int y = height - 2; y > 0 && width > 1; --y) {
    ring.push_back(y * width);
  }
  return ring;
}

// Two stretches of the ring, short or long, their gaps often a single edge.
void DrawTerminals(Rng& rng, BorderGrid& grid) {
  const std::vector<int> ring = RingNodes(grid.width, grid.height);
  const auto size = static_cast<int>(ring.size());
  std::array<int, 4> ends{};
  for (int& end : ends) {
    end = static_cast<int>(rng.NextBelow(size));
  }
  std::sort(ends.begin(), ends.end());
  if (ends[1] == ends[2]) {
    ends = {0, 0, size - 1, size - 1};
  }
  // Where the ring is a line, no stretch may pass its ends.
  const bool is_line = grid.width == 1 || grid.height == 1;
  const int turn = is_line ? 0 : static_cast<int>(rng.NextBelow(size));
  const auto stretch = [&](int first, int last, std::vector<int>& nodes) {
    for (int position = first; position <= last; ++position) {
      nodes.push_back(ring[(position + turn) % size]);
    }
    return BorderCut::Stretch{{nodes.front() % grid.width, nodes.front() / grid.width},
                              {nodes.back() % grid.width, nodes.back() / grid.width}};
  };
  grid.source = stretch(ends[0], ends[1], grid.source_nodes);
  grid.sink = stretch(ends[2], ends[3], grid.sink_nodes);
  if (rng.NextBelow(2) == 0) {
    std::swap(grid.source, grid.sink);
    std::swap(grid.source_nodes, grid.sink_nodes);
  }
}

// Many zero and equal capacities, so that there are ties and parts without a way to a terminal.
BorderGrid RandomBorderGrid(Rng& rng, int width, int height, int max_capacity) {
  BorderGrid grid(width, height);
  const auto capacity = [&] {
    return rng.NextBelow(4) == 0 ? 0 : static_cast<int>(rng.NextBelow(max_capacity + 1));
  };
  for (int i = 0; i < width * height; ++i) {
    grid.right[i] = {capacity(), capacity()};
    grid.down[i] = {capacity(), capacity()};
  }
  DrawTerminals(rng, grid);
  return grid;
}

TEST(BorderCutTest, MatchesBruteForceOnThousandsOfSmallGrids) {
  Rng rng(5);
  BorderCut cut;
  for (int round = 0; round < 6000; ++round) {
    const int width = 1 + static_cast<int>(rng.NextBelow(4));
    const int height = (width == 1 ? 2 : 1) + static_cast<int>(rng.NextBelow(3));
    const int max_capacity = round % 3 == 0 ? 2 : round % 3 == 1 ? 500 : BorderCut::kMaxCapacity;
    const BorderGrid grid = RandomBorderGrid(rng, width, height, max_capacity);
    const int64_t value = grid.Solve(cut);
    ASSERT_EQ(value, grid.BruteForce()) << "round " << round << ", " << width << "x" << height;
    grid.ExpectCut(cut, value);
    ASSERT_FALSE(HasFailure()) << "round " << round << ", " << width << "x" << height;
  }
}

TEST(BorderCutTest, MatchesGridCutOnLargerGrids) {
  Rng rng(6);
  BorderCut cut;
  GridCut grid_cut;
  for (int round = 0; round < 2000; ++round) {
    const int width = 1 + static_cast<int>(rng.NextBelow(30));
    const int height = 2 + static_cast<int>(rng.NextBelow(30));
    const int max_capacity = round % 3 == 0 ? 2 : round % 3 == 1 ? 500 : GridCut::kMaxCapacitySum / 2;
    const BorderGrid grid = RandomBorderGrid(rng, width, height, max_capacity);
    const int64_t value = grid.Solve(cut);
    ASSERT_EQ(value, grid.Solve(grid_cut)) << "round " << round << ", " << width << "x" << height;
    grid.ExpectCut(cut, value);
    ASSERT_FALSE(HasFailure()) << "round " << round << ", " << width << "x" << height;
  }
}

TEST(BorderCutTest, CutsAChainAtItsWeakestEdge) {
  BorderCut cut;
  cut.Reset(5, 1);
  cut.SetTerminals({{4, 0}, {4, 0}}, {{0, 0}, {0, 0}});
  const std::array<int, 4> towards_sink = {7, 9, 3, 8};
  for (int x = 0; x < 4; ++x) {
    cut.SetEdge(x, 0, GridCut::kRight, 1, towards_sink[x]);
  }
  EXPECT_EQ(cut.Solve(), 3);
  for (int x = 0; x < 5; ++x) {
    EXPECT_EQ(cut.OnSourceSide(x, 0), x >= 3) << x;
  }
}

TEST(BorderCutTest, WithoutCapacitiesStillPartsTheTerminals) {
  BorderGrid grid(3, 4);
  grid.source = {{2, 3}, {0, 0}};  // round a corner
  grid.source_nodes = {11, 10, 9, 6, 3, 0};
  grid.sink = {{1, 0}, {2, 2}};  // touches it at both ends
  grid.sink_nodes = {1, 2, 5, 8};
  BorderCut cut;
  EXPECT_EQ(grid.Solve(cut), 0);
  grid.ExpectCut(cut, 0);
}

TEST(BorderCutTest, ChoosesTheSameAmongEqualCutsAfterAnyOther) {
  Rng rng(8);
  BorderCut used;
  for (int round = 0; round < 50; ++round) {
    const BorderGrid grid = RandomBorderGrid(rng, 12, 9, 1);
    RandomBorderGrid(rng, 2 + static_cast<int>(rng.NextBelow(20)), 7, 60000).Solve(used);
    grid.Solve(used);
    BorderCut fresh;
    grid.Solve(fresh);
    for (int i = 0; i < grid.width * grid.height; ++i) {
      ASSERT_EQ(used.OnSourceSide(i % 12, i / 12), fresh.OnSourceSide(i % 12, i / 12)) << "round " << round;
    }
  }
}

}  // namespace
}  // namespace tessera
