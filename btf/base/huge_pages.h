// Large buffers in huge pages, where the system grants them: faulting in 4 KiB at a time can cost more than
// computing what is written there, and so can translating the addresses of scattered reads.
//
//   HugeBuffer<float> samples = AllocateHuge<float>(count);
#pragma once

#include <cstddef>
#include <memory>

namespace tessera {

inline constexpr size_t kHugePageBytes = size_t{2} << 20;
// Freed buffers are kept for later ones up to so many bytes in all: on a virtual machine fresh pages may come
// from its host at less than a gigabyte a second, slower than encoding fills them.
inline constexpr size_t kMaxKeptHugeBytes = size_t{256} << 20;

// Asks for huge pages for those that lie whole in [data, data + bytes), before they are touched.
void AdviseHugePages(void* data, size_t bytes);

// Memory of `bytes` (a multiple of kHugePageBytes), aligned to a huge page, with whatever was in it. A kept
// buffer of up to twice the size if there is one; else kept ones give way as far as the limit asks, the
// oldest first. Thread-safe. Throws std::bad_alloc.
struct HugeBlock {
  void* data = nullptr;
  size_t bytes = 0;
};
[[nodiscard]] HugeBlock TakeHugeBlock(size_t bytes);
void ReturnHugeBlock(HugeBlock block);
// Bytes of the blocks kept at the moment.
[[nodiscard]] size_t KeptHugeBlockBytes();

struct HugeDeleter {
  size_t bytes = 0;
  void operator()(void* data) const { ReturnHugeBlock({data, bytes}); }
};

template <typename T>
using HugeBuffer = std::unique_ptr<T[], HugeDeleter>;

// `count` values, not initialised. Throws std::bad_alloc.
template <typename T>
[[nodiscard]] HugeBuffer<T> AllocateHuge(size_t count) {
  const size_t bytes = (count * sizeof(T) + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  const HugeBlock block = TakeHugeBlock(bytes);
  return HugeBuffer<T>(static_cast<T*>(block.data), HugeDeleter{block.bytes});
}

}  // namespace tessera
