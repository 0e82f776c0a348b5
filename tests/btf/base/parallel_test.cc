#include "btf/base/parallel.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <set>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(ParallelForTest, CoversEveryIndexOnceForAnyThreadCount) {
  for (const int threads : {1, 2, 8}) {
    RunContext context;
    context.num_threads = threads;
    std::vector<std::atomic<int>> visits(1001);
    ParallelFor(context, 0, 1001, 10, [&](int64_t begin, int64_t end) {
      EXPECT_EQ(begin % 10, 0);
      EXPECT_LE(end - begin, 10);
      for (int64_t i = begin; i < end; ++i) {
        ++visits[i];
      }
    });
    for (const auto& count : visits) {
      EXPECT_EQ(count.load(), 1);
    }
  }
}

// On a machine with fewer cores too: tests of determinism ask for 8 threads and must get them.
TEST(ParallelForTest, StartsAsManyThreadsAsAsked) {
  constexpr std::chrono::seconds kPatience{20};
  for (const size_t threads : {2, 8}) {
    RunContext context;
    context.num_threads = static_cast<int>(threads);
    std::mutex mutex;
    std::condition_variable arrived;
    std::set<std::thread::id> ids;
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    ParallelFor(context, 0, context.num_threads, 1, [&](int64_t, int64_t) {
      std::unique_lock lock(mutex);
      ids.insert(std::this_thread::get_id());
      arrived.notify_all();
      arrived.wait_until(lock, deadline, [&] { return ids.size() == threads; });
    });
    EXPECT_EQ(ids.size(), threads);
  }
}

TEST(ParallelForTest, SkipsTheRestAfterAStopRequest) {
  std::stop_source stop;
  RunContext context;
  context.stop = stop.get_token();
  context.num_threads = 1;
  int visited = 0;
  ParallelFor(context, 0, 100, 1, [&](int64_t, int64_t) {
    ++visited;
    stop.request_stop();
  });
  EXPECT_EQ(visited, 1);
  EXPECT_EQ(context.CheckStop().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
