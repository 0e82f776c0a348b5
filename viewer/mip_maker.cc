#include "viewer/mip_maker.h"

#include <utility>

namespace tessera::viewer {

MipMaker::MipMaker(std::function<void()> made)
    : made_(std::move(made)), thread_([this](const std::stop_token& stop) { Run(stop); }) {}

MipMaker::~MipMaker() {
  thread_.request_stop();
  thread_.join();
}

MipMaker::Answer MipMaker::Get(const std::shared_ptr<const TileSet>& tile_set) {
  const std::lock_guard lock(mutex_);
  if (const Kept* const kept = kept_.Use(tile_set.get())) {
    return kept->answer;
  }
  if (running_ != tile_set) {
    wanted_ = tile_set;
    changed_.notify_one();
  }
  return {};
}

bool MipMaker::IsBusy() const {
  const std::lock_guard lock(mutex_);
  return wanted_ != nullptr || running_ != nullptr;
}

void MipMaker::Run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return wanted_ != nullptr; }) && !stop.stop_requested()) {
    running_ = std::exchange(wanted_, nullptr);
    const std::shared_ptr<const TileSet> tile_set = running_;
    lock.unlock();
    absl::StatusOr<TileMips> mips = MakeTileMips(*tile_set, {.max_bytes = kMostMipBytes}, {.stop = stop});
    Answer answer;
    uint64_t size_bytes = 0;
    if (mips.ok()) {
      size_bytes = mips->size_bytes();
      answer.mips = std::make_shared<const TileMips>(*std::move(mips));
    } else {
      answer.why_none = std::string(mips.status().message());
    }
    lock.lock();
    kept_.Put(tile_set.get(), {tile_set, std::move(answer)}, size_bytes);
    lock.unlock();
    made_();
    lock.lock();
    running_ = nullptr;
  }
}

}  // namespace tessera::viewer
