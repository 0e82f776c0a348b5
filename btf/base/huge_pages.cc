#include "btf/base/huge_pages.h"

#include <cstdint>
#include <cstdlib>
#include <mutex>
#include <new>
#include <vector>

#include <sys/mman.h>

namespace tessera {
namespace {

class KeptBlocks {
 public:
  // A kept block that fits; where there is none, {} and room for one of `bytes` beside what is kept.
  HugeBlock Take(size_t bytes) {
    const std::lock_guard lock(mutex_);
    for (auto block = blocks_.begin(); block != blocks_.end(); ++block) {
      if (block->bytes >= bytes && block->bytes / 2 <= bytes) {
        const HugeBlock taken = *block;
        blocks_.erase(block);
        total_ -= taken.bytes;
        return taken;
      }
    }
    MakeRoom(bytes);
    return {};
  }

  void Return(HugeBlock block) {
    const std::lock_guard lock(mutex_);
    if (block.bytes > kMaxKeptHugeBytes) {
      std::free(block.data);
      return;
    }
    MakeRoom(block.bytes);
    blocks_.push_back(block);
    total_ += block.bytes;
  }

  size_t total() {
    const std::lock_guard lock(mutex_);
    return total_;
  }

 private:
  void MakeRoom(size_t bytes) {
    while (!blocks_.empty() && total_ + bytes > kMaxKeptHugeBytes) {
      total_ -= blocks_.front().bytes;
      std::free(blocks_.front().data);
      blocks_.erase(blocks_.begin());
    }
  }

  std::mutex mutex_;
  std::vector<HugeBlock> blocks_;  // the oldest first; guarded by mutex_
  size_t total_ = 0;               // their bytes; guarded by mutex_
};

// Never destroyed: buffers may outlive static objects.
KeptBlocks& Kept() {
  static KeptBlocks* const kept = new KeptBlocks();
  return *kept;
}

}  // namespace

void AdviseHugePages(void* data, size_t bytes) {
  const uintptr_t begin =
      (reinterpret_cast<uintptr_t>(data) + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  const uintptr_t end = (reinterpret_cast<uintptr_t>(data) + bytes) / kHugePageBytes * kHugePageBytes;
  if (begin < end) {
    // Advice only: without it all works as well.
    madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
  }
}

HugeBlock TakeHugeBlock(size_t bytes) {
  const HugeBlock kept = Kept().Take(bytes);
  if (kept.data != nullptr) {
    return kept;
  }
  void* const data = std::aligned_alloc(kHugePageBytes, bytes);
  if (data == nullptr) {
    throw std::bad_alloc();
  }
  AdviseHugePages(data, bytes);
  return {data, bytes};
}

void ReturnHugeBlock(HugeBlock block) {
  Kept().Return(block);
}

size_t KeptHugeBlockBytes() {
  return Kept().total();
}

}  // namespace tessera
