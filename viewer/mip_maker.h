// Mip levels of tile sets, made on a thread of their own, so that neither window nor pictures wait for them.
//
//   MipMaker maker([] { draw the picture again; });
//   const MipMaker::Answer answer = maker.Get(tile_set);      // while drawing it
//   if (answer.mips != nullptr) ..
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

#include "btf/mips/tile_mips.h"
#include "btf/wang/tile_set.h"
#include "viewer/recent.h"

namespace tessera::viewer {

// Of the levels of one tile set, and of all that are kept.
inline constexpr uint64_t kMostMipBytes = uint64_t{512} << 20;
inline constexpr size_t kMostKeptMips = 12;
inline constexpr uint64_t kMostKeptMipBytes = uint64_t{1} << 30;

// Thread-safe.
class MipMaker {
 public:
  struct Answer {
    std::shared_ptr<const TileMips> mips;  // nullptr while they are made, or where there are none
    std::string why_none;                  // of a tile set that has none: what MakeTileMips says
  };

  // `made` is called from the maker's thread after each tile set, with levels or without.
  explicit MipMaker(std::function<void()> made);
  // Stops what runs and waits for it.
  ~MipMaker();
  MipMaker(const MipMaker&) = delete;
  MipMaker& operator=(const MipMaker&) = delete;

  // The levels of the tile set; where they were not made yet they are now, instead of another tile set's that
  // wait for their turn.
  Answer Get(const std::shared_ptr<const TileSet>& tile_set);
  // Levels are being made, or `made` has not returned.
  [[nodiscard]] bool IsBusy() const;

 private:
  struct Kept {
    std::shared_ptr<const TileSet> tile_set;  // so that its address stays its own
    Answer answer;
  };
  void Run(const std::stop_token& stop);

  const std::function<void()> made_;
  mutable std::mutex mutex_;  // guards what follows, up to running_
  std::condition_variable_any changed_;
  Recent<const TileSet*, Kept> kept_{kMostKeptMips, kMostKeptMipBytes};
  std::shared_ptr<const TileSet> wanted_;
  std::shared_ptr<const TileSet> running_;
  std::jthread thread_;  // last: it uses all of the above
};

}  // namespace tessera::viewer
