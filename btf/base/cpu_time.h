// Processor time: what others do on the machine does not count, unlike in wall-clock time.
#pragma once

#include <ctime>

namespace tessera {

inline double SecondsOfClock(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// Spent so far by the calling thread; by all threads of the process.
inline double ThreadCpuSeconds() {
  return SecondsOfClock(CLOCK_THREAD_CPUTIME_ID);
}
inline double ProcessCpuSeconds() {
  return SecondsOfClock(CLOCK_PROCESS_CPUTIME_ID);
}

}  // namespace tessera
