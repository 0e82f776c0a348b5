#include "btf/tiles/border_cut.h"

#include <algorithm>
#include <cassert>

namespace tessera {
namespace {

constexpr uint32_t kUnreached = UINT32_MAX;
// Distances that share a bucket: wide enough that few buckets are empty, narrow enough that few faces are
// seen twice.
constexpr int kBucketShift = 6;
constexpr size_t kNumBuckets = (BorderCut::kMaxCapacity >> kBucketShift) + 2;

}  // namespace

void BorderCut::Reset(int width, int height) {
  width_ = width;
  height_ = height;
  stride_ = width + 1;
  offset_[GridCut::kRight] = 1;
  offset_[GridCut::kUp] = -stride_;
  offset_[GridCut::kLeft] = -1;
  offset_[GridCut::kDown] = stride_;
  faces_.assign(static_cast<size_t>(stride_) * (height + 1), Face{.distance = kUnreached});
  entries_.clear();
  buckets_.resize(kNumBuckets);
}

// Clockwise from node (0, 0); what is not on the top or the right side is on the way back.
int BorderCut::RingPosition(const Node& node) const {
  if (node.y == 0) {
    return node.x;
  }
  if (node.x == width_ - 1) {
    return node.x + node.y;
  }
  return 2 * (width_ - 1 + height_ - 1) - node.x - node.y;
}

// The face outside between a node of the ring and the one after it.
BorderCut::Gate BorderCut::GateAfter(int ring_position) const {
  const int across = width_ - 1;
  const int along = height_ - 1;
  if (ring_position < across) {
    return {FaceAt(ring_position, -1), GridCut::kDown};
  }
  ring_position -= across;
  if (ring_position < along) {
    return {FaceAt(width_ - 1, ring_position), GridCut::kLeft};
  }
  ring_position -= along;
  if (ring_position < across) {
    return {FaceAt(across - 1 - ring_position, height_ - 1), GridCut::kUp};
  }
  ring_position -= across;
  return {FaceAt(-1, along - 1 - ring_position), GridCut::kRight};
}

void BorderCut::SetTerminals(const Stretch& source, const Stretch& sink) {
  const int ring = 2 * (width_ - 1 + height_ - 1);
  const auto steps = [&](const Node& from, const Node& to) {
    return (RingPosition(to) - RingPosition(from) + ring) % ring;
  };
  const int source_length = steps(source.first, source.last);
  const int gap = steps(source.last, sink.first);
  const int sink_length = steps(sink.first, sink.last);
  assert(gap > 0 && source_length + gap + sink_length < ring);
  source_node_ = source.first;
  // Outside, where no path may come: distance 0 keeps it away. The gap behind the sink stays in reach.
  for (int step = 0; step < source_length + gap + sink_length; ++step) {
    const Gate gate = GateAfter((RingPosition(source.first) + step) % ring);
    faces_[gate.face].distance = 0;
    if (step >= source_length && step < source_length + gap) {
      entries_.push_back(gate);
    }
  }
  for (int position = 0; position < ring; ++position) {
    faces_[GateAfter(position).face].outside = true;
  }
}

void BorderCut::Step(uint32_t face, int direction) {
  const uint32_t next_face = face + offset_[direction];
  Face& next = faces_[next_face];
  const uint32_t distance = faces_[face].distance + faces_[face].cost[direction];
  if (distance < next.distance) {
    next.distance = distance;
    next.from = static_cast<uint8_t>(direction);
    const uint32_t number = distance >> kBucketShift;
    buckets_[number % kNumBuckets].push_back(next_face);
    last_bucket_ = std::max(last_bucket_, number);
  }
}

int64_t BorderCut::Solve() {
  last_bucket_ = 0;
  for (const Gate& gate : entries_) {
    Step(gate.face, gate.inwards);
  }
  uint32_t last_face = kUnreached;
  uint32_t number = 0;
  for (; last_face == kUnreached; ++number) {
    std::vector<uint32_t>& bucket = buckets_[number % kNumBuckets];
    for (size_t i = 0; i < bucket.size(); ++i) {  // grows while it is worked through
      const uint32_t index = bucket[i];
      const Face& face = faces_[index];
      if (face.distance >> kBucketShift != number) {
        continue;  // has been seen, at a smaller distance
      }
      if (face.outside) {
        if (last_face == kUnreached || face.distance < faces_[last_face].distance) {
          last_face = index;
        }
        continue;
      }
      for (int direction = 0; direction < 4; ++direction) {
        Step(index, direction);
      }
    }
    bucket.clear();
  }
  for (; number <= last_bucket_; ++number) {
    buckets_[number % kNumBuckets].clear();
  }
  MarkSides(last_face);
  return faces_[last_face].distance;
}

// Follows the path back to its start; along rows and the first column, sides change where it crosses.
void BorderCut::MarkSides(uint32_t last_face) {
  constexpr uint8_t kCutFromLeft = 1;  // from the left neighbour
  constexpr uint8_t kCutFromUp = 2;
  on_source_side_.assign(static_cast<size_t>(width_) * height_, 0);
  uint32_t face = last_face;
  do {
    const int x = static_cast<int>(face) % stride_ - 1;
    const int y = static_cast<int>(face) / stride_ - 1;
    const int direction = faces_[face].from;
    // The node below and right of the edge that the last step crossed, or at its end.
    const bool across = direction == GridCut::kUp || direction == GridCut::kDown;
    const int node_x = direction == GridCut::kRight ? x : x + 1;
    const int node_y = direction == GridCut::kDown ? y : y + 1;
    on_source_side_[static_cast<size_t>(node_y) * width_ + node_x] |= across ? kCutFromLeft : kCutFromUp;
    face -= offset_[direction];
  } while (!faces_[face].outside);

  uint8_t row_side = 1;
  for (int y = 0; y < height_; ++y) {
    uint8_t* const row = on_source_side_.data() + static_cast<size_t>(y) * width_;
    row_side ^= (row[0] & kCutFromUp) != 0 ? 1 : 0;
    uint8_t side = row_side;
    for (int x = 0; x < width_; ++x) {
      side ^= row[x] & kCutFromLeft;
      row[x] = side;
    }
  }
  if (!OnSourceSide(source_node_.x, source_node_.y)) {
    for (uint8_t& side : on_source_side_) {
      side ^= 1;
    }
  }
}

}  // namespace tessera
