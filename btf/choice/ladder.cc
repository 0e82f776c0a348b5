#include "btf/choice/ladder.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>

#include <absl/strings/str_cat.h>

namespace tessera {
namespace {

constexpr std::array kRanks = {1,  2,  3,  4,  5,  6,  8,  10,  12,  14,  16,  20,  24, 28,
                               32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256};
constexpr std::array kRankStops = {16, 32, 64, 128, 256};
constexpr std::array kEigenTextures = {1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 24, 32};
constexpr std::array kEigenTextureStops = {3, 8, 16, 32};
// Light before view: highlights move twice as fast with the light.
constexpr std::array<std::pair<int, int>, 13> kOrders = {{{1, 1},
                                                          {4, 1},
                                                          {4, 4},
                                                          {9, 4},
                                                          {9, 9},
                                                          {16, 9},
                                                          {16, 16},
                                                          {25, 16},
                                                          {25, 25},
                                                          {36, 25},
                                                          {36, 36},
                                                          {49, 36},
                                                          {49, 49}}};
constexpr std::array<size_t, 5> kOrderStops = {4, 6, 8, 10, 12};

Ladder DfmfLadder(uint64_t num_texels, const EncodeParams& params) {
  Ladder ladder{.codec = "dfmf"};
  for (const int rank : kRanks) {
    if (std::ranges::count(kRankStops, rank) > 0) {
      ladder.stops.push_back(ladder.rungs.size());
    }
    Setting setting{absl::StrCat("rank ", rank), params, num_texels * rank};
    setting.params.rank = rank;
    ladder.rungs.push_back(std::move(setting));
  }
  return ladder;
}

Ladder DshLadder(std::string codec, uint64_t num_texels, const EncodeParams& params) {
  Ladder ladder{.codec = std::move(codec)};
  for (const auto& [kl, kv] : kOrders) {
    Setting setting{absl::StrCat(kl, "x", kv), params, num_texels * 3 * kl * kv};
    setting.params.kl = kl;
    setting.params.kv = kv;
    ladder.rungs.push_back(std::move(setting));
  }
  ladder.stops.assign(kOrderStops.begin(), kOrderStops.end());
  return ladder;
}

Ladder ViewPcaLadder(const BtfInfo& info, uint64_t num_texels, const EncodeParams& params) {
  Ladder ladder{.codec = "view-pca", .projects_on_harmonics = false};
  for (const int c : kEigenTextures) {
    if (c > 1 && std::cmp_greater_equal(c, info.lights.size())) {
      break;
    }
    if (std::ranges::count(kEigenTextureStops, c) > 0) {
      ladder.stops.push_back(ladder.rungs.size());
    }
    Setting setting{absl::StrCat("c ", c), params, num_texels * 3 * info.views.size() * (c + 1)};
    setting.params.eigen_textures = c;
    ladder.rungs.push_back(std::move(setting));
  }
  if (ladder.stops.empty() || ladder.stops.back() + 1 != ladder.rungs.size()) {
    ladder.stops.push_back(ladder.rungs.size() - 1);
  }
  return ladder;
}

}  // namespace

std::vector<Ladder> ChoiceLadders(const BtfInfo& info, const EncodeParams& params) {
  const uint64_t num_texels = static_cast<uint64_t>(info.width) * info.height;
  EncodeParams bare;
  bare.memory_budget_bytes = params.memory_budget_bytes;
  bare.spill_folder = params.spill_folder;
  return {DfmfLadder(num_texels, bare), DshLadder("dsh", num_texels, bare),
          DshLadder("dsh-cls", num_texels, bare), ViewPcaLadder(info, num_texels, bare)};
}

}  // namespace tessera
