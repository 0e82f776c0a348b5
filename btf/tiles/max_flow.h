// Minimum cuts of 4-connected grids with terminals, the graphs that patch seams make.
//
//   GridCut cut(width, height);
//   cut.AddTerminals(x, y, GridCut::kPinned, 0);              // pinned to the source side
//   cut.SetEdge(x, y, GridCut::kRight, 310, 310);             // to (x + 1, y), forth and back
//   int64_t value = cut.Solve();
//   bool source_side = cut.OnSourceSide(x, y);
//
// Integers throughout, so that a cut is exact and the same on every machine. Incremental breadth-first search
// [Goldberg2011]: two shortest-path trees grow level by level from the terminals; a path that joins them is
// augmented; nodes cut off by it are adopted at the lowest level that has a residual arc to them, or set
// free. A node takes 16 bytes. Differs from [Goldberg2011] in that children are found by looking at the four
// neighbours, not by lists.
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
    flow_ += std::min(from_source, to_sink) + std::max(0, std::min(node.terminal, -added)) +
             std::max(0, std::min(-node.terminal, added));
    node.terminal += added;
  }

  // The value of the minimum cut. Call once after setting up.
  int64_t Solve();

  // After Solve: the side of a minimum cut that (x, y) lies on.
  [[nodiscard]] bool OnSourceSide(int x, int y) const {
    const uint32_t tree = nodes_[Index(x, y)].label & kTreeMask;
    return sink_tree_closed_ ? tree != kSinkTree : tree == kSourceTree;
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

 private:
  // label = distance << 5 | parent << 2 | tree. Distance counts arcs from the terminal, which has 0.
  struct Node {
    uint16_t residual[4] = {0, 0, 0, 0};  // of the arcs that leave, by Direction
    int32_t terminal = 0;                 // > 0: residual from the source; < 0: to the sink
    uint32_t label = 0;
  };
  static_assert(sizeof(Node) == 16);

  static constexpr uint32_t kTreeMask = 3, kFree = 0, kSourceTree = 1, kSinkTree = 2;
  static constexpr int kParentShift = 2, kDistanceShift = 5;
  static constexpr uint32_t kParentMask = 7, kParentTerminal = 4, kParentNone = 5;

  static uint32_t MakeLabel(uint32_t distance, uint32_t parent, uint32_t tree) {
    return distance << kDistanceShift | parent << kParentShift | tree;
  }
  static uint32_t Tree(const Node& node) { return node.label & kTreeMask; }
  static uint32_t Parent(const Node& node) { return node.label >> kParentShift & kParentMask; }
  static uint32_t Distance(const Node& node) { return node.label >> kDistanceShift; }

  [[nodiscard]] size_t Index(int x, int y) const { return static_cast<size_t>(y + 1) * stride_ + x + 1; }

  template <uint32_t kTree>
  [[nodiscard]] uint32_t ArcFromParent(uint32_t node, int direction) const;
  template <uint32_t kTree>
  void GrowLevel();
  void Augment(uint32_t source_node, int direction);
  template <uint32_t kTree>
  void Push(uint32_t node, int amount);
  template <uint32_t kTree>
  [[nodiscard]] int Bottleneck(uint32_t node, int amount) const;
  template <uint32_t kTree>
  void MakeOrphan(uint32_t node);
  template <uint32_t kTree>
  void Adopt();

  int width_ = 0;
  int height_ = 0;
  int stride_ = 0;
  int offset_[4] = {0, 0, 0, 0};
  int64_t flow_ = 0;
  bool sink_tree_closed_ = false;
  std::vector<Node> nodes_;  // with a border of empty nodes
  // Of the source tree and the sink tree: nodes of the outermost complete level, those of the level being
  // made, its number, and whether the level beyond is being made.
  struct Side {
    std::vector<uint32_t> frontier;
    std::vector<uint32_t> next;
    uint32_t level = 1;
    bool growing = false;
    std::vector<std::vector<uint32_t>> orphans;  // by distance
    uint32_t lowest_orphan = UINT32_MAX;
    uint32_t highest_orphan = 0;
  };
  Side sides_[3];  // by tree; [0] is not used
};

}  // namespace tessera
