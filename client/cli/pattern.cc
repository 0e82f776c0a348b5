#include "client/cli/pattern.h"

#include <vector>

#include <fmt/format.h>

namespace tessera::cli {
namespace {

bool HasNumber(const Json& object, const char* key) {
  return object.is_object() && object.contains(key) && object[key].is_number();
}

// Vectors of numbers in round brackets; empty where it is anything else.
std::string VectorsText(const Json& vectors) {
  std::vector<std::string> texts;
  for (const Json& vector : vectors) {
    if (!vector.is_array() || vector.size() != 2 || !vector[0].is_number() || !vector[1].is_number()) {
      return "";
    }
    texts.push_back(fmt::format("({:.1f}, {:.1f})", vector[0].get<double>(), vector[1].get<double>()));
  }
  return fmt::format("{}", fmt::join(texts, " and "));
}

}  // namespace

std::string PatternText(const Json& pattern) {
  std::vector<std::string> parts;
  if (HasNumber(pattern, "anisotropy")) {
    parts.push_back(fmt::format("anisotropy {:.2f}", pattern["anisotropy"].get<double>()));
    if (HasNumber(pattern, "anisotropy_limit")) {
      parts.back() += fmt::format(" (isotropic 1, limit of turned strips {:.2f})",
                                  pattern["anisotropy_limit"].get<double>());
    }
  }
  if (HasNumber(pattern, "feature_size")) {
    parts.push_back(fmt::format("features of {:.1f} texels", pattern["feature_size"].get<double>()));
  }
  if (pattern.is_object() && pattern.contains("period")) {
    if (const std::string vectors = VectorsText(pattern["period"]); !vectors.empty()) {
      parts.push_back(fmt::format("repeats every {} texels", vectors));
    }
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace tessera::cli
