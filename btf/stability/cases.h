// What the stability table does to the codecs.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"
#include "btf/stability/analytic_btf.h"

namespace tessera {

enum class MethodSet {
  kStandard,  // every codec at a usual setting
  kOrders,  // "dsh-ls", "dsh-cls" and "dsh" with 1x1 to 49x49 functions, with the figures that only they have
  kRanks,   // "dfmf" and "view-pca" from one component to more than there can be
};

struct StabilityCase {
  std::string stress;
  AnalyticSurface surface;
  std::vector<Direction> views;
  std::vector<Direction> lights;
  // Changes samples in the layout of BtfSource::ReadRows; the truth stays what `surface` says.
  std::function<void(const BtfInfo& info, std::vector<float>& samples)> harm = {};
  // Every sample and the truth are this instead.
  std::optional<double> constant = std::nullopt;
  // Errors everywhere are then taken at this polar angle of light and view alone.
  std::optional<double> decode_theta_rad = std::nullopt;
  MethodSet methods = MethodSet::kStandard;
};

struct StabilityMethod {
  std::string codec;
  std::string setting;  // "kl 25, kv 25"
  EncodeParams params;
};

[[nodiscard]] std::vector<StabilityCase> StabilityCases();
[[nodiscard]] std::vector<StabilityMethod> MethodsOf(MethodSet set);

// The rows' promise: the relative error everywhere, absent where a refusal is promised.
[[nodiscard]] std::optional<double> PromisedLimit(const StabilityCase& c, const StabilityMethod& method);

}  // namespace tessera
