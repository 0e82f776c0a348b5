// SHA-256 of a stream of bytes, computed on a thread of its own while the next bytes arrive.
#pragma once

#include <condition_variable>
#include <mutex>
#include <queue>
#include <string>
#include <string_view>
#include <thread>

#include "btf/base/sha256.h"

namespace tessera {

// One stream; used by one thread at a time.
class BackgroundSha256 {
 public:
  BackgroundSha256();
  // Bytes not hashed yet are dropped.
  ~BackgroundSha256();
  BackgroundSha256(const BackgroundSha256&) = delete;
  BackgroundSha256& operator=(const BackgroundSha256&) = delete;

  // `bytes` must stay as they are until Wait, HexDigest or the destructor has returned.
  void Add(std::string_view bytes);
  // Returns when all that was added is hashed.
  void Wait();
  // Waits, too. 64 lower-case hexadecimal digits; the object must not be used afterwards.
  [[nodiscard]] std::string HexDigest();

 private:
  void Run();

  std::mutex mutex_;  // guards what follows, up to digest_
  std::condition_variable changed_;
  std::queue<std::string_view> parts_;  // the first one is being hashed
  bool ending_ = false;
  Sha256 digest_;  // of the thread, as long as there are parts
  std::thread thread_;
};

}  // namespace tessera
