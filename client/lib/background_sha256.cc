#include "client/lib/background_sha256.h"

#include <span>

namespace tessera {

BackgroundSha256::BackgroundSha256() : thread_([this] { Run(); }) {}

BackgroundSha256::~BackgroundSha256() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void BackgroundSha256::Add(std::string_view bytes) {
  {
    const std::lock_guard lock(mutex_);
    parts_.push(bytes);
  }
  changed_.notify_all();
}

void BackgroundSha256::Wait() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return parts_.empty(); });
}

std::string BackgroundSha256::HexDigest() {
  Wait();
  return digest_.HexDigest();
}

void BackgroundSha256::Run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return ending_ || !parts_.empty(); });
    if (ending_) {
      return;
    }
    const std::string_view part = parts_.front();
    lock.unlock();
    digest_.Update(std::as_bytes(std::span(part)));
    lock.lock();
    parts_.pop();
    if (parts_.empty()) {
      changed_.notify_all();
    }
  }
}

}  // namespace tessera
