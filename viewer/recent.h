// Things that were used recently, kept within a budget; the one that was not used for longest goes first.
#pragma once

#include <algorithm>
#include <cstdint>
#include <list>
#include <utility>

namespace tessera::viewer {

// Not thread-safe. Linear search: for tens of things.
template <typename Key, typename Value>
class Recent {
 public:
  // At most `max_count` things of `max_cost` together; one is kept whatever it costs.
  Recent(size_t max_count, uint64_t max_cost) : max_count_(max_count), max_cost_(max_cost) {}

  // The value, now the most recently used, or nullptr. Valid until the next Put or Clear.
  Value* Use(const Key& key) {
    const auto found = Find(key);
    if (found == entries_.end()) {
      return nullptr;
    }
    entries_.splice(entries_.begin(), entries_, found);
    return &entries_.front().value;
  }

  [[nodiscard]] bool Contains(const Key& key) const {
    return std::any_of(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.key == key; });
  }

  // The most recently used from now on; replaces a value of that key.
  Value& Put(Key key, Value value, uint64_t cost) {
    if (const auto old = Find(key); old != entries_.end()) {
      cost_ -= old->cost;
      entries_.erase(old);
    }
    entries_.push_front({std::move(key), std::move(value), cost});
    cost_ += cost;
    while (entries_.size() > 1 && (entries_.size() > max_count_ || cost_ > max_cost_)) {
      cost_ -= entries_.back().cost;
      entries_.pop_back();
    }
    return entries_.front().value;
  }

  void Clear() {
    entries_.clear();
    cost_ = 0;
  }
  [[nodiscard]] size_t size() const { return entries_.size(); }
  [[nodiscard]] uint64_t cost() const { return cost_; }

 private:
  struct Entry {
    Key key;
    Value value;
    uint64_t cost = 0;
  };
  typename std::list<Entry>::iterator Find(const Key& key) {
    return std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.key == key; });
  }

  const size_t max_count_;
  const uint64_t max_cost_;
  std::list<Entry> entries_;  // most recently used first
  uint64_t cost_ = 0;
};

}  // namespace tessera::viewer
