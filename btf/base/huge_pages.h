// Large buffers in huge pages, where the system grants them: faulting in 4 KiB at a time can cost more than
// computing what is written there, and so can translating the addresses of scattered reads.
#pragma once

#include <cstddef>
#include <cstdint>

#include <sys/mman.h>

namespace tessera {

inline constexpr size_t kHugePageBytes = size_t{2} << 20;

// Asks for huge pages for those that lie whole in [data, data + bytes), before they are touched.
inline void AdviseHugePages(void* data, size_t bytes) {
  const uintptr_t begin =
      (reinterpret_cast<uintptr_t>(data) + kHugePageBytes - 1) / kHugePageBytes * kHugePageBytes;
  const uintptr_t end = (reinterpret_cast<uintptr_t>(data) + bytes) / kHugePageBytes * kHugePageBytes;
  if (begin < end) {
    // Advice only: without it all works as well.
    madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
  }
}

}  // namespace tessera
