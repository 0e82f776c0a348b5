// The first few of many faults, and how many there are: what a user needs to find them.
#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace tessera {

class ErrorList {
 public:
  void Add(std::string fault) {
    ++count_;
    if (first_.size() < kNamed) {
      first_.push_back(std::move(fault));
    }
  }
  // Faults that are only counted.
  void AddUnnamed(size_t count) { count_ += count; }

  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] size_t count() const { return count_; }
  // "a; b; c; and 12 more"
  [[nodiscard]] std::string Text() const {
    std::string text;
    for (const std::string& fault : first_) {
      text += (text.empty() ? "" : "; ") + fault;
    }
    return count_ > first_.size() ? text + "; and " + std::to_string(count_ - first_.size()) + " more" : text;
  }

  static constexpr size_t kNamed = 5;

 private:
  std::vector<std::string> first_;
  size_t count_ = 0;
};

}  // namespace tessera
