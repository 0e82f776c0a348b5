#include "btf/tiles/max_flow.h"

#include <algorithm>

namespace tessera {

void GridCut::Reset(int width, int height) {
  width_ = width;
  height_ = height;
  stride_ = width + 2;
  offset_[kRight] = 1;
  offset_[kUp] = -stride_;
  offset_[kLeft] = -1;
  offset_[kDown] = stride_;
  flow_ = 0;
  sink_tree_closed_ = false;
  nodes_.assign(static_cast<size_t>(stride_) * (height + 2), Node{});
}

// The residual of the arc that would carry flow between `node` and its neighbour in `direction` if that were
// its parent: from parent to child in the source tree, from child to parent in the sink tree.
template <uint32_t kTree>
uint32_t GridCut::ArcFromParent(uint32_t node, int direction) const {
  if constexpr (kTree == kSourceTree) {
    return nodes_[node + offset_[direction]].residual[direction ^ 2];
  } else {
    return nodes_[node].residual[direction];
  }
}

int64_t GridCut::Solve() {
  for (Side& side : sides_) {
    side.frontier.clear();
    side.next.clear();
    side.level = 1;
    side.growing = false;
  }
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const size_t index = Index(x, y);
      Node& node = nodes_[index];
      if (node.terminal != 0) {
        const uint32_t tree = node.terminal > 0 ? kSourceTree : kSinkTree;
        node.label = MakeLabel(1, kParentTerminal, tree);
        sides_[tree].frontier.push_back(static_cast<uint32_t>(index));
      }
    }
  }
  // The tree with the smaller frontier grows; when one has no frontier left, it can grow no more and its
  // boundary is saturated.
  while (true) {
    const bool source_closed = sides_[kSourceTree].frontier.empty();
    sink_tree_closed_ = sides_[kSinkTree].frontier.empty();
    if (source_closed || sink_tree_closed_) {
      break;
    }
    if (sides_[kSourceTree].frontier.size() <= sides_[kSinkTree].frontier.size()) {
      GrowLevel<kSourceTree>();
    } else {
      GrowLevel<kSinkTree>();
    }
  }
  return flow_;
}

template <uint32_t kTree>
void GridCut::GrowLevel() {
  Side& side = sides_[kTree];
  side.growing = true;
  side.next.clear();
  // Nodes relabelled to this level while it is scanned have been scanned before, at a lower one; nothing is
  // appended.
  for (const uint32_t index : side.frontier) {
    int direction = 0;
    while (direction < 4) {
      const Node& node = nodes_[index];
      if (Tree(node) != kTree || Distance(node) != side.level) {
        break;  // relabelled or set free since
      }
      const uint32_t neighbour = index + offset_[direction];
      const uint32_t residual =
          kTree == kSourceTree ? node.residual[direction] : nodes_[neighbour].residual[direction ^ 2];
      if (residual == 0) {
        ++direction;
        continue;
      }
      Node& other = nodes_[neighbour];
      const uint32_t other_tree = Tree(other);
      if (other_tree == kFree) {
        other.label = MakeLabel(side.level + 1, static_cast<uint32_t>(direction ^ 2), kTree);
        side.next.push_back(neighbour);
        ++direction;
      } else if (other_tree == kTree) {
        ++direction;
      } else if constexpr (kTree == kSourceTree) {
        Augment(index, direction);
      } else {
        Augment(neighbour, direction ^ 2);
      }
    }
  }
  side.growing = false;
  ++side.level;
  side.frontier.swap(side.next);
}

template <uint32_t kTree>
int GridCut::Bottleneck(uint32_t node, int amount) const {
  while (true) {
    const uint32_t parent = Parent(nodes_[node]);
    if (parent == kParentTerminal) {
      return std::min(amount, std::abs(nodes_[node].terminal));
    }
    amount = std::min(amount, static_cast<int>(ArcFromParent<kTree>(node, static_cast<int>(parent))));
    node += offset_[parent];
  }
}

template <uint32_t kTree>
void GridCut::Push(uint32_t node, int amount) {
  while (true) {
    Node& child = nodes_[node];
    const uint32_t parent = Parent(child);
    if (parent == kParentTerminal) {
      child.terminal += kTree == kSourceTree ? -amount : amount;
      if (child.terminal == 0) {
        MakeOrphan<kTree>(node);
      }
      return;
    }
    const uint32_t next = node + offset_[parent];
    uint16_t& with_flow = kTree == kSourceTree ? nodes_[next].residual[parent ^ 2] : child.residual[parent];
    uint16_t& against_flow =
        kTree == kSourceTree ? child.residual[parent] : nodes_[next].residual[parent ^ 2];
    with_flow = static_cast<uint16_t>(with_flow - amount);
    against_flow = static_cast<uint16_t>(against_flow + amount);
    if (with_flow == 0) {
      MakeOrphan<kTree>(node);
    }
    node = next;
  }
}

// Saturates the path source .. source_node -> its neighbour in `direction` .. sink.
void GridCut::Augment(uint32_t source_node, int direction) {
  const uint32_t sink_node = source_node + offset_[direction];
  int amount = nodes_[source_node].residual[direction];
  amount = Bottleneck<kSourceTree>(source_node, amount);
  amount = Bottleneck<kSinkTree>(sink_node, amount);
  nodes_[source_node].residual[direction] =
      static_cast<uint16_t>(nodes_[source_node].residual[direction] - amount);
  nodes_[sink_node].residual[direction ^ 2] =
      static_cast<uint16_t>(nodes_[sink_node].residual[direction ^ 2] + amount);
  Push<kSourceTree>(source_node, amount);
  Push<kSinkTree>(sink_node, amount);
  flow_ += amount;
  Adopt<kSourceTree>();
  Adopt<kSinkTree>();
}

template <uint32_t kTree>
void GridCut::MakeOrphan(uint32_t node) {
  Side& side = sides_[kTree];
  const uint32_t distance = Distance(nodes_[node]);
  nodes_[node].label = MakeLabel(distance, kParentNone, kTree);
  if (distance >= side.orphans.size()) {
    side.orphans.resize(distance + 1);
  }
  side.orphans[distance].push_back(node);
  side.lowest_orphan = std::min(side.lowest_orphan, distance);
  side.highest_orphan = std::max(side.highest_orphan, distance);
}

// Gives every orphan the parent of lowest distance that it can have, in ascending order of distance, or sets
// it free.
template <uint32_t kTree>
void GridCut::Adopt() {
  Side& side = sides_[kTree];
  if (side.lowest_orphan == UINT32_MAX) {
    return;
  }
  const uint32_t highest_label = side.level + (side.growing ? 1 : 0);
  for (uint32_t distance = side.lowest_orphan; distance <= side.highest_orphan; ++distance) {
    // Orphans of this distance may be appended while it is worked through, never of a lower one.
    for (size_t i = 0; i < side.orphans[distance].size(); ++i) {
      const uint32_t index = side.orphans[distance][i];
      Node& node = nodes_[index];
      uint32_t best_distance = highest_label;
      uint32_t best_direction = kParentNone;
      for (uint32_t direction = 0; direction < 4; ++direction) {
        if (ArcFromParent<kTree>(index, static_cast<int>(direction)) == 0) {
          continue;
        }
        const Node& candidate = nodes_[index + offset_[direction]];
        if (Tree(candidate) == kTree && Distance(candidate) < best_distance) {
          best_distance = Distance(candidate);
          best_direction = direction;
          if (best_distance + 1 == distance) {
            break;
          }
        }
      }
      if (best_direction != kParentNone && best_distance + 1 == distance) {
        node.label = MakeLabel(distance, best_direction, kTree);
        continue;
      }
      for (uint32_t direction = 0; direction < 4; ++direction) {
        const uint32_t child = index + offset_[direction];
        if (Tree(nodes_[child]) == kTree && Parent(nodes_[child]) == (direction ^ 2)) {
          MakeOrphan<kTree>(child);
        }
      }
      if (best_direction == kParentNone) {
        node.label = kFree;
        continue;
      }
      node.label = MakeLabel(best_distance + 1, best_direction, kTree);
      if (best_distance + 1 == highest_label) {
        (side.growing ? side.next : side.frontier).push_back(index);
      }
    }
    side.orphans[distance].clear();
  }
  side.lowest_orphan = UINT32_MAX;
  side.highest_orphan = 0;
}

}  // namespace tessera
