#include "btf/tiles/max_flow.h"

#include <array>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/rng.h"

namespace tessera {
namespace {

// A grid with terminals in plain form, for the oracle.
struct Grid {
  int width = 0;
  int height = 0;
  std::vector<std::array<int, 2>> right, down;  // there, back; by y * width + x
  std::vector<std::array<int, 2>> terminals;    // from the source, to the sink

  Grid(int w, int h)
      : width(w), height(h), right(w * h, {0, 0}), down(w * h, {0, 0}), terminals(w * h, {0, 0}) {}

  // Value of the cut whose source side is {i : bit i of `source`}.
  [[nodiscard]] int64_t CutValue(uint32_t source) const {
    int64_t value = 0;
    for (int i = 0; i < width * height; ++i) {
      const bool here = (source >> i & 1u) != 0;
      value += here ? terminals[i][1] : terminals[i][0];
      const auto edge = [&](const std::array<int, 2>& capacity, int j) {
        const bool there = (source >> j & 1u) != 0;
        value += here && !there ? capacity[0] : 0;
        value += there && !here ? capacity[1] : 0;
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

  // The value of the minimum cuts and their source sides together, which are one of them.
  struct Oracle {
    int64_t value = INT64_MAX;
    uint32_t source = 0;
  };
  [[nodiscard]] Oracle BruteForce() const {
    Oracle best;
    for (uint32_t source = 0; source < (1u << (width * height)); ++source) {
      const int64_t value = CutValue(source);
      if (value < best.value) {
        best = {value, source};
      } else if (value == best.value) {
        best.source |= source;
      }
    }
    return best;
  }

  void Fill(GridCut& cut) const {
    cut.Reset(width, height);
    for (int i = 0; i < width * height; ++i) {
      const int x = i % width;
      const int y = i / width;
      cut.AddTerminals(x, y, terminals[i][0], terminals[i][1]);
      if (x + 1 < width) {
        cut.SetEdge(x, y, GridCut::kRight, right[i][0], right[i][1]);
      }
      if (y + 1 < height) {
        cut.SetEdge(x, y, GridCut::kDown, down[i][0], down[i][1]);
      }
    }
  }
};

uint32_t SourceSide(const GridCut& cut) {
  uint32_t source = 0;
  for (int i = 0; i < cut.width() * cut.height(); ++i) {
    source |= cut.OnSourceSide(i % cut.width(), i / cut.width()) ? 1u << i : 0u;
  }
  return source;
}

// Many zero and equal capacities: ties and unreachable parts are where tree bookkeeping goes wrong.
Grid RandomGrid(Rng& rng, int width, int height, int max_capacity) {
  Grid grid(width, height);
  const auto capacity = [&] {
    return rng.NextBelow(4) == 0 ? 0 : static_cast<int>(rng.NextBelow(max_capacity + 1));
  };
  const uint64_t terminal_odds = 1 + rng.NextBelow(6);
  for (int i = 0; i < width * height; ++i) {
    grid.right[i] = {capacity(), capacity()};
    grid.down[i] = {capacity(), capacity()};
    if (rng.NextBelow(terminal_odds) == 0) {
      grid.terminals[i] = {capacity() * 2, capacity() * 2};
    }
  }
  return grid;
}

TEST(GridCutTest, MatchesBruteForceOnThousandsOfSmallGrids) {
  Rng rng(7);
  GridCut cut;
  for (int round = 0; round < 6000; ++round) {
    const int width = 1 + static_cast<int>(rng.NextBelow(4));
    const int height = 1 + static_cast<int>(rng.NextBelow(3));
    const int max_capacity = round % 3 == 0 ? 3 : round % 3 == 1 ? 50 : GridCut::kMaxCapacitySum / 2;
    const Grid grid = RandomGrid(rng, width, height, max_capacity);
    grid.Fill(cut);
    const int64_t value = cut.Solve();
    const Grid::Oracle oracle = grid.BruteForce();
    ASSERT_EQ(value, oracle.value) << "round " << round << ", " << width << "x" << height;
    ASSERT_EQ(value, grid.CutValue(SourceSide(cut))) << "round " << round << ": sides are not the cut";
    ASSERT_EQ(SourceSide(cut), oracle.source) << "round " << round << ": not the least sink side";
  }
}

// Larger grids, against an augmenting-path solver that shares nothing with the code under test.
int64_t SlowMaxFlow(const Grid& grid) {
  const int n = grid.width * grid.height;
  std::vector<std::array<int64_t, 4>> residual(n, {0, 0, 0, 0});
  const std::array<int, 4> step = {1, -grid.width, -1, grid.width};
  for (int i = 0; i < n; ++i) {
    if (i % grid.width + 1 < grid.width) {
      residual[i][0] = grid.right[i][0];
      residual[i + 1][2] = grid.right[i][1];
    }
    if (i + grid.width < n) {
      residual[i][3] = grid.down[i][0];
      residual[i + grid.width][1] = grid.down[i][1];
    }
  }
  auto terminals = grid.terminals;
  int64_t flow = 0;
  while (true) {
    std::vector<int> from(n, -1);  // arc that reached the node; 4 for the source
    std::vector<int> queue;
    for (int i = 0; i < n; ++i) {
      if (terminals[i][0] > 0) {
        from[i] = 4;
        queue.push_back(i);
      }
    }
    int end = -1;
    for (size_t head = 0; head < queue.size() && end < 0; ++head) {
      const int i = queue[head];
      if (terminals[i][1] > 0) {
        end = i;
        break;
      }
      for (int d = 0; d < 4; ++d) {
        if (residual[i][d] > 0 && from[i + step[d]] < 0) {
          from[i + step[d]] = d;
          queue.push_back(i + step[d]);
        }
      }
    }
    if (end < 0) {
      return flow;
    }
    int64_t amount = terminals[end][1];
    int i = end;
    for (; from[i] != 4; i -= step[from[i]]) {
      amount = std::min(amount, residual[i - step[from[i]]][from[i]]);
    }
    amount = std::min<int64_t>(amount, terminals[i][0]);
    terminals[i][0] -= static_cast<int>(amount);
    for (i = end; from[i] != 4; i -= step[from[i]]) {
      residual[i - step[from[i]]][from[i]] -= amount;
      residual[i][from[i] ^ 2] += amount;
    }
    terminals[end][1] -= static_cast<int>(amount);
    flow += amount;
  }
}

int64_t CutValueOfLabels(const Grid& grid, const GridCut& cut) {
  int64_t value = 0;
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const int i = y * grid.width + x;
      const bool here = cut.OnSourceSide(x, y);
      value += grid.terminals[i][here ? 1 : 0];
      if (x + 1 < grid.width && cut.OnSourceSide(x + 1, y) != here) {
        value += grid.right[i][here ? 0 : 1];
      }
      if (y + 1 < grid.height && cut.OnSourceSide(x, y + 1) != here) {
        value += grid.down[i][here ? 0 : 1];
      }
    }
  }
  return value;
}

TEST(GridCutTest, MatchesAugmentingPathsOnLargerGrids) {
  Rng rng(11);
  GridCut cut;
  for (int round = 0; round < 120; ++round) {
    const int width = 5 + static_cast<int>(rng.NextBelow(28));
    const int height = 5 + static_cast<int>(rng.NextBelow(28));
    Grid grid = RandomGrid(rng, width, height, round % 2 == 0 ? 4 : 1000);
    grid.Fill(cut);
    const int64_t value = cut.Solve();
    ASSERT_EQ(value, SlowMaxFlow(grid)) << "round " << round;
    ASSERT_EQ(value, CutValueOfLabels(grid, cut)) << "round " << round;
  }
}

TEST(GridCutTest, MayEndEarlyOnlyWhereEveryCutCostsEnough) {
  Rng rng(5);
  GridCut cut;
  for (int round = 0; round < 60; ++round) {
    Grid grid = RandomGrid(rng, 12, 9, 1000);
    const int64_t value = SlowMaxFlow(grid);
    grid.Fill(cut);
    ASSERT_EQ(cut.Solve(value + 1), value) << "round " << round;
    ASSERT_EQ(CutValueOfLabels(grid, cut), value) << "round " << round;
    grid.Fill(cut);
    const int64_t early = cut.Solve(value / 2);
    ASSERT_GE(early, value / 2) << "round " << round;
    ASSERT_LE(early, value) << "round " << round;
  }
}

TEST(GridCutTest, PinnedSidesAreCutBetween) {
  const int n = 64;
  Rng rng(3);
  Grid grid(n, n);
  for (int i = 0; i < n * n; ++i) {
    const int right = static_cast<int>(rng.NextBelow(1000)) + 1;
    const int down = static_cast<int>(rng.NextBelow(1000)) + 1;
    grid.right[i] = {right, right};
    grid.down[i] = {down, down};
  }
  for (int y = 0; y < n; ++y) {
    grid.terminals[y * n][0] = GridCut::kPinned;
    grid.terminals[y * n + n - 1][1] = GridCut::kPinned;
  }
  GridCut cut;
  grid.Fill(cut);
  const int64_t value = cut.Solve();
  EXPECT_EQ(value, CutValueOfLabels(grid, cut));
  for (int y = 0; y < n; ++y) {
    EXPECT_TRUE(cut.OnSourceSide(0, y));
    EXPECT_FALSE(cut.OnSourceSide(n - 1, y));
  }
}

TEST(GridCutTest, CountsFlowThatPassesStraightThroughANode) {
  GridCut cut(1, 1);
  cut.AddTerminals(0, 0, 5, 0);
  cut.AddTerminals(0, 0, 2, 9);
  EXPECT_EQ(cut.Solve(), 7);
  EXPECT_FALSE(cut.OnSourceSide(0, 0));
}

}  // namespace
}  // namespace tessera
