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
  nodes_.assign(static_cast<size_t>(stride_) * (height + 2), Node{});
}

int64_t GridCut::Solve(int64_t enough) {
  const int64_t num_nodes = static_cast<int64_t>(width_) * height_;
  // Heights leave no gaps, so there are at most as many as nodes.
  num_at_height_.resize(num_nodes + 1);
  // Measured once for as many nodes raised as there are: both take about the same time.
  while (flow_ < enough && MeasureHeights()) {
    while (num_raised_ < num_nodes && !next_active_.empty()) {
      active_.swap(next_active_);
      next_active_.clear();
      for (const uint32_t index : active_) {
        if (nodes_[index].height != kNoWay) {
          Discharge(index);
        }
        if (flow_ >= enough) {
          return flow_;
        }
      }
    }
  }
  return flow_;
}

// Breadth-first from what leads to the sink, against the arcs. Returns whether any excess has a way there.
bool GridCut::MeasureHeights() {
  next_active_.clear();
  std::fill(num_at_height_.begin(), num_at_height_.end(), 0);
  by_height_.clear();
  num_raised_ = 0;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const size_t index = Index(x, y);
      Node& node = nodes_[index];
      node.height = node.excess < 0 ? 0 : kNoWay;
      if (node.excess < 0) {
        by_height_.push_back(static_cast<uint32_t>(index));
      }
    }
  }
  for (size_t i = 0; i < by_height_.size(); ++i) {  // grows while it is worked through
    const uint32_t index = by_height_[i];
    const Node& node = nodes_[index];
    ++num_at_height_[node.height];
    if (node.excess > 0) {
      next_active_.push_back(index);
    }
    for (int direction = 0; direction < 4; ++direction) {
      const uint32_t neighbour = index + offset_[direction];
      Node& other = nodes_[neighbour];
      if (other.height == kNoWay && other.residual[direction ^ 2] != 0) {
        other.height = node.height + 1;
        by_height_.push_back(neighbour);
      }
    }
  }
  return !next_active_.empty();
}

// Pushes the excess of a node down, raising it as often as it takes, until none is left or no way is.
void GridCut::Discharge(uint32_t index) {
  Node& node = nodes_[index];
  while (true) {
    uint32_t lowest = kNoWay;
    for (int direction = 0; direction < 4; ++direction) {
      if (node.residual[direction] == 0) {
        continue;
      }
      const uint32_t neighbour = index + offset_[direction];
      Node& other = nodes_[neighbour];
      if (other.height + 1 != node.height) {
        lowest = std::min(lowest, other.height);
        continue;
      }
      const int amount = std::min<int>(node.excess, node.residual[direction]);
      node.residual[direction] = static_cast<uint16_t>(node.residual[direction] - amount);
      other.residual[direction ^ 2] = static_cast<uint16_t>(other.residual[direction ^ 2] + amount);
      node.excess -= amount;
      const bool was_active = other.excess > 0;
      flow_ += std::clamp(-other.excess, 0, amount);
      other.excess += amount;
      if (!was_active && other.excess > 0) {
        next_active_.push_back(neighbour);
      }
      if (node.excess == 0) {
        return;
      }
    }
    ++num_raised_;
    if (--num_at_height_[node.height] == 0) {
      CutOffAbove(node.height);
      node.height = kNoWay;
      return;
    }
    if (lowest == kNoWay) {
      node.height = kNoWay;
      return;
    }
    node.height = lowest + 1;
    ++num_at_height_[node.height];
  }
}

// For a height that has no nodes: those above it have no way to the sink.
void GridCut::CutOffAbove(uint32_t height) {
  for (Node& node : nodes_) {
    if (node.height > height) {
      node.height = kNoWay;
    }
  }
  for (size_t above = height + 1; above < num_at_height_.size() && num_at_height_[above] > 0; ++above) {
    num_at_height_[above] = 0;
  }
}

}  // namespace tessera
