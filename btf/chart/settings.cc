#include "btf/chart/settings.h"

#include <absl/strings/str_cat.h>

namespace tessera {

std::vector<ChartSetting> ChartSettings(ChartSize size) {
  const bool is_full = size == ChartSize::kFull;
  std::vector<ChartSetting> settings;
  const auto add_dsh = [&](const char* method, const char* codec, ClsEnergy energy,
                           const std::vector<int>& counts) {
    for (const int count : counts) {
      settings.push_back(
          {method, absl::StrCat(count, "x", count), codec, {.kl = count, .kv = count, .cls_energy = energy}});
    }
  };
  const std::vector<int> orders = is_full ? std::vector<int>{4, 9, 16, 25, 36, 49} : std::vector<int>{4, 25};
  const std::vector<int> few = {25};
  // It fails at all but the smallest: a few show it.
  add_dsh("dsh-ls", "dsh-ls", ClsEnergy::kHemisphere, is_full ? std::vector<int>{4, 9, 25, 49} : few);
  add_dsh("dsh-cls", "dsh-cls", ClsEnergy::kHemisphere, orders);
  add_dsh("dsh-cls 4pi", "dsh-cls", ClsEnergy::kSphere, is_full ? orders : few);
  add_dsh("dsh", "dsh", ClsEnergy::kHemisphere, orders);
  for (const int c : is_full ? std::vector<int>{1, 2, 3, 5, 8, 12} : std::vector<int>{1, 5}) {
    settings.push_back({"view-pca", absl::StrCat("c ", c), "view-pca", {.eigen_textures = c}});
  }
  for (const int rank : is_full ? std::vector<int>{4, 8, 16, 32, 48, 64, 96} : std::vector<int>{8, 32}) {
    settings.push_back({"dfmf", absl::StrCat("rank ", rank), "dfmf", {.rank = rank}});
  }
  return settings;
}

std::vector<int> ChartJpegQualities(ChartSize size) {
  return size == ChartSize::kFull ? std::vector<int>{1, 10, 25, 50, 75, 90} : std::vector<int>{10, 75};
}

}  // namespace tessera
