// Minimum cuts of 4-connected grids between two stretches of their outer border, without max-flow.
//
//   BorderCut cut;
//   cut.Reset(width, height);
//   cut.SetTerminals({{0, height - 1}, {0, 0}},                       // source: the left column, upwards
//                    {{width - 1, 0}, {width - 1, height - 1}});      // sink: the right column, downwards
//   cut.SetEdge(x, y, GridCut::kRight, 310, 290);                     // to (x + 1, y), forth and back
//   int64_t value = cut.Solve();
//   bool source_side = cut.OnSourceSide(x, y);
//
// clang-format off
//     s . . t    With both terminals on the outer face, a cut is a path of faces from the gap behind the source
//     s . . t    to the gap behind the sink, seen clockwise (here from above to below), and an edge costs what
//     s . . t    it carries from the path's right hand, the source's side, to its left. The minimum cut is a
//                shortest such path [Itai1979]; its value is GridCut's on the same graph.
// clang-format on
//
// Faces wait in buckets by distance, several distances in one, and are seen again when one of their own
// bucket improves them: exact, and integers throughout. Among cuts of one value the choice is arbitrary, but
// the same on every machine.
//
// One BorderCut per thread; Reset keeps the memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "btf/tiles/max_flow.h"

namespace tessera {

class BorderCut {
 public:
  static constexpr int kMaxCapacity = 65535;

  struct Node {
    int x = 0;
    int y = 0;
  };
  // Nodes of the border ring, clockwise from `first` to `last`, row 0 on top. In a grid one node wide or high
  // the ring runs along one side to the end and back; a node means its place on the way there.
  struct Stretch {
    Node first;
    Node last;
  };

  // A grid without edges or terminals. width, height >= 1, 2 <= width * height, width + height < 2^15.
  void Reset(int width, int height);

  // Stretches that share no node. Call once after Reset.
  void SetTerminals(const Stretch& source, const Stretch& sink);

  // The edge from (x, y) to its neighbour in `direction`: capacities there and back in [0, kMaxCapacity].
  // Replaces what was set. Both ends must lie inside the grid.
  void SetEdge(int x, int y, GridCut::Direction direction, int capacity, int capacity_back) {
    const auto there = static_cast<uint16_t>(capacity);
    const auto back = static_cast<uint16_t>(capacity_back);
    switch (direction) {
      case GridCut::kRight:
        SetRight(x, y, there, back);
        break;
      case GridCut::kDown:
        SetDown(x, y, there, back);
        break;
      case GridCut::kLeft:
        SetRight(x - 1, y, back, there);
        break;
      case GridCut::kUp:
        SetDown(x, y - 1, back, there);
        break;
    }
  }

  // The value of the minimum cut. Call once after setting up. O(n) for n nodes of capacities that are alike.
  int64_t Solve();

  // After Solve: the side of a minimum cut that (x, y) lies on.
  [[nodiscard]] bool OnSourceSide(int x, int y) const {
    return on_source_side_[static_cast<size_t>(y) * width_ + x] != 0;
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

 private:
  // What lies between four nodes, or, on the rim, outside between two.
  struct Face {
    uint16_t cost[4] = {0, 0, 0, 0};  // of going on to the next face, by GridCut::Direction
    uint32_t distance = 0;            // from the gap behind the source
    uint8_t from = 0;                 // direction of the last step here
    bool outside = false;
  };
  static_assert(sizeof(Face) == 16);

  // The face below and right of node (x, y); -1 stands for outside.
  [[nodiscard]] uint32_t FaceAt(int x, int y) const {
    return static_cast<uint32_t>((y + 1) * stride_ + x + 1);
  }
  void SetRight(int x, int y, uint16_t there, uint16_t back) {
    const uint32_t below = FaceAt(x, y);
    faces_[below - stride_].cost[GridCut::kDown] = there;
    faces_[below].cost[GridCut::kUp] = back;
  }
  void SetDown(int x, int y, uint16_t there, uint16_t back) {
    const uint32_t right = FaceAt(x, y);
    faces_[right].cost[GridCut::kLeft] = there;
    faces_[right - 1].cost[GridCut::kRight] = back;
  }

  struct Gate {
    uint32_t face = 0;  // outside
    int inwards = 0;    // direction
  };
  [[nodiscard]] int RingPosition(const Node& node) const;
  [[nodiscard]] Gate GateAfter(int ring_position) const;
  void Step(uint32_t face, int direction);
  void MarkSides(uint32_t last_face);

  int width_ = 0;
  int height_ = 0;
  int stride_ = 0;
  int offset_[4] = {0, 0, 0, 0};
  Node source_node_;
  std::vector<Face> faces_;  // [height + 1][width + 1], those outside on the rim
  std::vector<Gate> entries_;
  std::vector<std::vector<uint32_t>> buckets_;  // of faces, by distance, used in turn
  uint32_t last_bucket_ = 0;                    // that holds a face, numbered by distance
  std::vector<uint8_t> on_source_side_;         // [height][width]
};

}  // namespace tessera
