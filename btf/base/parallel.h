// Parallel loops over index ranges, on TBB. Bodies write to disjoint places, so results never depend on the
// number of threads; reductions are done by the caller, in index order.
//
//   ParallelFor(context, 0, num_rows, 8, [&](int64_t begin, int64_t end) { ... });
#pragma once

#include <cstdint>
#include <functional>

#include "btf/base/run_context.h"

namespace tessera {

// Calls body(begin, end) on disjoint ranges that cover [begin, end). Ranges are cut at multiples of `grain`
// from `begin` (so a body may key scratch or generators by begin / grain), each at most `grain` long. At most
// context.num_threads threads. After a stop request the remaining ranges are skipped: check
// context.CheckStop() after.
void ParallelFor(const RunContext& context, int64_t begin, int64_t end, int64_t grain,
                 const std::function<void(int64_t begin, int64_t end)>& body);

// The number of threads a loop under `context` uses, at least 1.
[[nodiscard]] int NumThreads(const RunContext& context);

}  // namespace tessera
