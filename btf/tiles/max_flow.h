// Minimum cuts of 4-connected grids with terminals, the graphs that patch seams make.
//
//   GridCut cut(width, height);
//   cut.AddTerminals(x, y, GridCut::kPinned, 0);              // pinned to the source side
//   cut.SetEdge(x, y, GridCut::kRight, 310, 310);             // to (x + 1, y), forth and back
//   int64_t value = cut.Solve();
//   bool source_side = cut.OnSourceSide(x, y);
//
// Integers throughout, so that a cut is exact and the same on every machine. Push-relabel [Goldberg1988]:
// excess is pushed along arcs that descend towards the sink, first come, first served, and a node that has
// excess but no such arc is raised; all heights are measured anew once in a while, and what stands above an
// empty height has no way down [Cherkassky1997]. Only the cut is found: excess that cannot reach the sink
// stays where it is. A node takes 16 bytes.
//
// One GridCut per thread; Reset keeps the memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

class GridCut {
 public:
  // Largest sum of the two capacities of an edge.
  static constexpr int kMaxCapacitySum = 65535;
  // A terminal capacity that no cut severs: more than the four edges of a node can carry.
  static constexpr int kPinned = 1 << 20;

  enum Direction { kRight = 0, kUp = 1, kLeft = 2, kDown = 3 };  // up: towards row 0

  GridCut() = default;
  GridCut(int width, int height) { Reset(width, height); }

  // A grid without edges or terminals. width, height >= 1, width * height < 2^26.
  void Reset(int width, int height);

  // The edge from (x, y) to its neighbour in `direction`: capacities there and back, at least 0, their sum at
  // most kMaxCapacitySum. Replaces what was set. Both ends must lie inside the grid.
  void SetEdge(int x, int y, Direction direction, int capacity, int capacity_back) {
    const size_t from = Index(x, y);
    const size_t to = from + offset_[direction];
    nodes_[from].residual[direction] = static_cast<uint16_t>(capacity);
    nodes_[to].residual[direction ^ 2] = static_cast<uint16_t>(capacity_back);
  }

  // Adds capacities source -> (x, y) and (x, y) -> sink, each in [0, kPinned]. At most eight calls a node.
  void AddTerminals(int x, int y, int from_source, int to_sink) {
    Node& node = nodes_[Index(x, y)];
    const int added = from_source - to_sink;
    // What can run straight from source to sink through this node does.
    flow_ += std::min(from_source, to_sink) + std::max(0, std::min(node.excess, -added)) +
             std::max(0, std::min(-node.excess, added));
    node.excess += added;
  }

  // The value of the minimum cut. Call once after setting up. Where every cut costs `enough` or more, it may
  // end early with a value of at least that, and the sides mean nothing.
  int64_t Solve(int64_t enough = INT64_MAX);

  // After Solve: the side of the minimum cut that (x, y) lies on, of several the one whose sink side is
  // least.
  [[nodiscard]] bool OnSourceSide(int x, int y) const { return nodes_[Index(x, y)].height == kNoWay; }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

 private:
  static constexpr uint32_t kNoWay = UINT32_MAX >> 1;  // leads to the sink

  struct Node {
    uint16_t residual[4] = {0, 0, 0, 0};  // of the arcs that leave, by Direction
    int32_t excess = 0;                   // < 0: what can still go from here to the sink
    uint32_t height = kNoWay;             // at most the number of arcs to a node that leads to the sink
  };
  static_assert(sizeof(Node) == 16);

  [[nodiscard]] size_t Index(int x, int y) const { return static_cast<size_t>(y + 1) * stride_ + x + 1; }

  bool MeasureHeights();
  void Discharge(uint32_t index);
  void CutOffAbove(uint32_t height);

  int width_ = 0;
  int height_ = 0;
  int stride_ = 0;
  int offset_[4] = {0, 0, 0, 0};
  int64_t flow_ = 0;
  std::vector<Node> nodes_;  // with a border of empty nodes
  // Nodes with excess that may have a way to the sink: of this pass, and of the next, in the order they got
  // it.
  std::vector<uint32_t> active_;
  std::vector<uint32_t> next_active_;
  std::vector<int> num_at_height_;   // of all nodes that have a height
  std::vector<uint32_t> by_height_;  // nodes, while heights are measured
  int64_t num_raised_ = 0;           // since heights were measured
};

}  // namespace tessera
