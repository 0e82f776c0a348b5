#include "btf/stability/cases.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string_view>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/rng.h"
#include "btf/data/direction_sets.h"

namespace tessera {
namespace {

std::vector<Direction> NamedDirections(std::string_view name) {
  return *DirectionSet(name);  // the names below are legal
}

std::vector<Direction> RandomDirections(int count, uint64_t seed) {
  Rng rng(seed);
  std::vector<Direction> directions;
  for (int i = 0; i < count; ++i) {
    const double z = rng.NextDouble();  // uniform in solid angle
    directions.push_back({std::acos(z), 2.0 * kPi * rng.NextDouble()});
  }
  return directions;
}

std::vector<Direction> Beyond(std::vector<Direction> directions, double theta_deg) {
  std::erase_if(directions, [&](const Direction& d) { return d.theta_rad < RadFromDeg(theta_deg) - 1e-9; });
  return directions;
}

// Normal deviates, Box and Muller.
void AddNoise(double decibels, std::vector<float>& samples) {
  double sum = 0.0;
  for (const float v : samples) {
    sum += static_cast<double>(v) * v;
  }
  const double sigma =
      std::sqrt(sum / static_cast<double>(samples.size())) * std::pow(10.0, -decibels / 20.0);
  Rng rng(77);
  for (float& v : samples) {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - rng.NextDouble()));
    v += static_cast<float>(sigma * radius * std::cos(2.0 * kPi * rng.NextDouble()));
  }
}

// Visits every sample of one image.
template <typename F>
void ForImage(const BtfInfo& info, size_t view, size_t light, std::vector<float>& samples, F&& change) {
  const size_t num_images = info.views.size() * info.lights.size();
  for (size_t i = view * info.lights.size() + light; i < samples.size(); i += num_images) {
    change(samples[i]);
  }
}

// What was measured, and a quarter more: a row that becomes worse than this has lost something. Cases that
// are missing promise a refusal.
const std::map<std::string, std::map<std::string, double>>& CaseLimits() {
  static const std::map<std::string, std::map<std::string, double>> limits = {
      {"none", {{"dsh-ls", 1.6}, {"dsh-cls", 0.07}, {"dsh", 0.058}, {"dfmf", 0.028}, {"view-pca", 0.076}}},
      {"20 random lights and views",
       {{"dsh-ls", 0.62}, {"dsh-cls", 0.28}, {"dsh", 0.29}, {"dfmf", 0.14}, {"view-pca", 0.24}}},
      {"curet directions, 50",
       {{"dsh-ls", 0.21}, {"dsh-cls", 0.097}, {"dsh", 0.063}, {"dfmf", 0.041}, {"view-pca", 0.095}}},
      {"decoded at 80 degrees",
       {{"dsh-ls", 2.2}, {"dsh-cls", 0.16}, {"dsh", 0.15}, {"dfmf", 0.065}, {"view-pca", 0.11}}},
      {"decoded at 85 degrees",
       {{"dsh-ls", 2.2}, {"dsh-cls", 0.16}, {"dsh", 0.15}, {"dfmf", 0.065}, {"view-pca", 0.11}}},
      {"decoded at 89 degrees",
       {{"dsh-ls", 2.2}, {"dsh-cls", 0.16}, {"dsh", 0.15}, {"dfmf", 0.065}, {"view-pca", 0.11}}},
      {"no direction below 45 degrees",
       {{"dsh-ls", 0.14}, {"dsh-cls", 0.37}, {"dsh", 0.14}, {"dfmf", 0.089}, {"view-pca", 0.3}}},
      {"one image of value 10",
       {{"dsh-ls", 1.9}, {"dsh-cls", 0.1}, {"dsh", 0.1}, {"dfmf", 0.074}, {"view-pca", 0.08}}},
      {"highlights clipped at 0.8",
       {{"dsh-ls", 30}, {"dsh-cls", 0.44}, {"dsh", 0.41}, {"dfmf", 0.37}, {"view-pca", 0.43}}},
      {"noise 40 dB",
       {{"dsh-ls", 2.8}, {"dsh-cls", 0.07}, {"dsh", 0.058}, {"dfmf", 0.028}, {"view-pca", 0.076}}},
      {"noise 30 dB",
       {{"dsh-ls", 5.2}, {"dsh-cls", 0.07}, {"dsh", 0.059}, {"dfmf", 0.031}, {"view-pca", 0.077}}},
      {"noise 20 dB",
       {{"dsh-ls", 19}, {"dsh-cls", 0.073}, {"dsh", 0.071}, {"dfmf", 0.047}, {"view-pca", 0.081}}},
      {"all black",
       {{"dsh-ls", 0.001}, {"dsh-cls", 0.001}, {"dsh", 0.001}, {"dfmf", 0.001}, {"view-pca", 0.001}}},
      {"one constant",
       {{"dsh-ls", 0.001}, {"dsh-cls", 0.057}, {"dsh", 0.001}, {"dfmf", 0.001}, {"view-pca", 0.001}}},
      {"lobe of exponent 3000",
       {{"dsh-ls", 290}, {"dsh-cls", 0.85}, {"dsh", 0.87}, {"dfmf", 0.92}, {"view-pca", 0.91}}},
      {"1x1 texels",
       {{"dsh-ls", 0.049}, {"dsh-cls", 0.059}, {"dsh", 0.049}, {"dfmf", 0.011}, {"view-pca", 0.035}}},
      {"1x16 texels",
       {{"dsh-ls", 2.1}, {"dsh-cls", 0.072}, {"dsh", 0.059}, {"dfmf", 0.019}, {"view-pca", 0.065}}},
  };
  return limits;
}

struct OrderLimits {
  std::string_view codec;
  std::array<double, 7> by_order;
};
constexpr std::array<OrderLimits, 3> kOrderLimits = {{
    {"dsh-ls", {0.61, 0.23, 0.15, 0.23, 1.6, 11, 0.17}},
    {"dsh-cls", {0.77, 0.32, 0.19, 0.13, 0.07, 0.05, 0.033}},
    {"dsh", {0.61, 0.23, 0.15, 0.088, 0.058, 0.041, 0.03}},
}};

struct RankLimit {
  std::string_view setting;
  double limit;
};
constexpr std::array kRankLimits = {
    RankLimit{"rank 1", 0.5},
    RankLimit{"rank 36", 0.013},
    RankLimit{"rank 1000", 0.013},
    RankLimit{"1 eigen-textures", 0.34},
    RankLimit{"81 eigen-textures", 0.042},
    RankLimit{"255 eigen-textures", 0.042},
};

}  // namespace

std::vector<StabilityCase> StabilityCases() {
  const std::vector<Direction> ubo = NamedDirections("ubo81");
  const AnalyticSurface plain;
  std::vector<StabilityCase> cases;
  cases.push_back({"none", plain, ubo, ubo});
  StabilityCase orders{"8 bits, every order", plain, ubo, ubo};
  orders.methods = MethodSet::kOrders;
  cases.push_back(std::move(orders));
  StabilityCase ranks{"36 texels, ranks up to and beyond theirs", plain, ubo, ubo};
  ranks.methods = MethodSet::kRanks;
  cases.push_back(std::move(ranks));
  cases.push_back({"20 random lights and views", plain, RandomDirections(20, 5), RandomDirections(20, 6)});
  cases.push_back({"curet directions, 50", plain, NamedDirections("curet"), NamedDirections("curet")});
  for (const double theta_deg : {80.0, 85.0, 89.0}) {
    StabilityCase grazing{absl::StrCat("decoded at ", theta_deg, " degrees"), plain, ubo, ubo};
    grazing.decode_theta_rad = RadFromDeg(theta_deg);
    cases.push_back(std::move(grazing));
  }
  cases.push_back({"no direction below 45 degrees", plain, Beyond(ubo, 45.0), Beyond(ubo, 45.0)});
  cases.push_back(
      {"one image of value 10", plain, ubo, ubo, [](const BtfInfo& info, std::vector<float>& samples) {
         ForImage(info, 40, 17, samples, [](float& v) { v = 10.0F; });
       }});
  AnalyticSurface glossy = plain;
  glossy.shininess = 60.0;
  glossy.specular = 2.0;
  cases.push_back({"highlights clipped at 0.8", glossy, ubo, ubo,
                   [](const BtfInfo& /*info*/, std::vector<float>& samples) {
                     for (float& v : samples) {
                       v = std::min(v, 0.8F);
                     }
                   }});
  for (const double decibels : {40.0, 30.0, 20.0}) {
    cases.push_back(
        {absl::StrCat("noise ", decibels, " dB"), plain, ubo, ubo,
         [decibels](const BtfInfo& /*info*/, std::vector<float>& samples) { AddNoise(decibels, samples); }});
  }
  for (const auto& [stress, value] : {std::pair("all black", 0.0), std::pair("one constant", 0.5)}) {
    StabilityCase flat{stress, plain, ubo, ubo};
    flat.constant = value;
    cases.push_back(std::move(flat));
  }
  AnalyticSurface mirror = plain;
  mirror.shininess = 3000.0;
  mirror.specular = 20.0;
  cases.push_back({"lobe of exponent 3000", mirror, ubo, ubo});
  AnalyticSurface small = plain;
  small.width = 1;
  small.height = 1;
  cases.push_back({"1x1 texels", small, ubo, ubo});
  small.height = 16;
  cases.push_back({"1x16 texels", small, ubo, ubo});
  cases.push_back(
      {"a view with a NaN", plain, ubo, ubo, [](const BtfInfo& info, std::vector<float>& samples) {
         ForImage(info, 3, 5, samples, [](float& v) { v = std::numeric_limits<float>::quiet_NaN(); });
       }});
  return cases;
}

namespace {

std::vector<StabilityMethod> StandardMethods() {
  const EncodeParams harmonics{.kl = 25, .kv = 25};
  return {{"dsh-ls", "kl 25, kv 25", harmonics},
          {"dsh-cls", "kl 25, kv 25", harmonics},
          {"dsh", "kl 25, kv 25", harmonics},
          {"dfmf", "rank 16", {.rank = 16}},
          {"view-pca", "5 eigen-textures", {.eigen_textures = 5}}};
}

}  // namespace

std::vector<StabilityMethod> MethodsOf(MethodSet set) {
  if (set == MethodSet::kStandard) {
    return StandardMethods();
  }
  std::vector<StabilityMethod> methods;
  if (set == MethodSet::kRanks) {
    for (const int rank : {1, 36, 1000}) {
      methods.push_back({"dfmf", absl::StrCat("rank ", rank), {.rank = rank}});
    }
    for (const int count : {1, 81, 255}) {
      methods.push_back({"view-pca", absl::StrCat(count, " eigen-textures"), {.eigen_textures = count}});
    }
    return methods;
  }
  for (const char* codec : {"dsh-ls", "dsh-cls", "dsh"}) {
    for (int order = 1; order <= 7; ++order) {
      const int n = order * order;
      methods.push_back({codec, absl::StrCat("kl ", n, ", kv ", n), {.kl = n, .kv = n}});
    }
  }
  return methods;
}

std::optional<double> PromisedLimit(const StabilityCase& c, const StabilityMethod& method) {
  if (c.methods == MethodSet::kOrders) {
    const auto* const found = std::ranges::find(kOrderLimits, method.codec, &OrderLimits::codec);
    const auto order = static_cast<size_t>(std::lround(std::sqrt(method.params.kl)));
    return found == kOrderLimits.end() ? std::nullopt : std::optional(found->by_order[order - 1]);
  }
  if (c.methods == MethodSet::kRanks) {
    const auto* const found = std::ranges::find(kRankLimits, method.setting, &RankLimit::setting);
    return found == kRankLimits.end() ? std::nullopt : std::optional(found->limit);
  }
  const auto& table = CaseLimits();
  const auto found = table.find(c.stress);
  if (found == table.end()) {
    return std::nullopt;
  }
  const auto limit = found->second.find(method.codec);
  return limit == found->second.end() ? std::nullopt : std::optional(limit->second);
}

}  // namespace tessera
