#include "btf/base/parallel.h"

#include <atomic>
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
