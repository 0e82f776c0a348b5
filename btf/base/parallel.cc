#include "btf/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <thread>
#include <vector>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace tessera {

int NumThreads(const RunContext& context) {
  const int cores = std::max(1, tbb::this_task_arena::max_concurrency());
  return context.num_threads > 0 ? context.num_threads : cores;
}

void ParallelFor(const RunContext& context, int64_t begin, int64_t end, int64_t grain,
                 const std::function<void(int64_t begin, int64_t end)>& body) {
  if (begin >= end) {
    return;
  }
  const int64_t step = std::max<int64_t>(1, grain);
  const int64_t num_ranges = (end - begin + step - 1) / step;
  const auto run = [&](int64_t range) {
    if (!context.stop.stop_requested()) {
      body(begin + range * step, std::min(end, begin + (range + 1) * step));
    }
  };
  if (num_ranges == 1 || context.num_threads == 1) {
    for (int64_t range = 0; range < num_ranges; ++range) {
      run(range);
    }
    return;
  }
  const int num_threads = NumThreads(context);
#ifdef TESSERA_THREAD_SANITIZER
  // The installed TBB is not instrumented: the sanitizer would miss how it orders the ranges and report every
  // loop. It checks the bodies on plain threads instead.
  std::atomic<int64_t> next_range = 0;
  std::vector<std::jthread> threads;
  for (int64_t i = 0; i < std::min<int64_t>(num_threads, num_ranges); ++i) {
    threads.emplace_back([&] {
      for (int64_t range = next_range++; range < num_ranges; range = next_range++) {
        run(range);
      }
    });
  }
#else
  // TBB starts no more threads than there are cores unless told so.
  std::optional<tbb::global_control> more_threads;
  if (num_threads > tbb::this_task_arena::max_concurrency()) {
    more_threads.emplace(tbb::global_control::max_allowed_parallelism, num_threads);
  }
  tbb::task_arena arena(num_threads);
  arena.execute([&] { tbb::parallel_for(int64_t{0}, num_ranges, run, tbb::simple_partitioner{}); });
#endif
}

}  // namespace tessera
