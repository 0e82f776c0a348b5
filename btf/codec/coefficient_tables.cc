#include "btf/codec/coefficient_tables.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

namespace tessera {
namespace {

absl::Status Misshapen(const std::string& table, const std::vector<int64_t>& shape, int num_coefficients) {
  return absl::InvalidArgumentError(absl::StrCat("codec table '", table, "': shape [",
                                                 absl::StrJoin(shape, ", "), "] does not fit ",
                                                 num_coefficients, " coefficients"));
}

int64_t SizeOfShape(const std::vector<int64_t>& shape) {
  return std::accumulate(shape.begin(), shape.end(), int64_t{1}, std::multiplies());
}

}  // namespace

absl::StatusOr<CoefficientTables> CoefficientTables::Of(const BtfelTable& table) {
  const std::string& codec_id = table.codec_id;
  const int num_coefficients = table.num_coefficients;
  CoefficientTables result;
  // The last index of the table runs over coefficients first .. first + count - 1.
  const auto add_columns = [&](const std::string& name, int64_t first, int64_t count) {
    const auto found = table.tables.find(name);
    if (found == table.tables.end()) {
      return absl::OkStatus();
    }
    const std::vector<int64_t>& shape = found->second.shape;
    if (shape.empty() || shape.back() != count || count < 1) {
      return Misshapen(name, shape, num_coefficients);
    }
    Rule rule{SizeOfShape(shape), SizeOfShape(shape), count, std::vector<int64_t>(num_coefficients, -1)};
    std::iota(rule.column_of.begin() + first, rule.column_of.begin() + first + count, int64_t{0});
    result.rules_[name] = std::move(rule);
    return absl::OkStatus();
  };
  if (codec_id == "dfmf" && table.tables.contains("luma")) {
    const std::vector<int64_t>& luma = table.tables.at("luma").shape;
    const int64_t rank = luma.empty() ? 0 : luma.back();
    if (rank < 1 || rank > num_coefficients) {
      return Misshapen("luma", luma, num_coefficients);
    }
    for (const char* suffix : {"", "_offset", "_step"}) {
      if (absl::Status s = add_columns(absl::StrCat("luma", suffix), 0, rank); !s.ok()) {
        return s;
      }
      if (absl::Status s = add_columns(absl::StrCat("chroma", suffix), rank, num_coefficients - rank);
          !s.ok()) {
        return s;
      }
    }
  }
  if (codec_id == "view-pca" && table.tables.contains("light_weights")) {
    const std::vector<int64_t>& shape = table.tables.at("light_weights").shape;
    const bool fits = shape.size() == 3 && shape[0] > 0 && num_coefficients == shape[0] * 3 * (shape[2] + 1);
    if (!fits) {
      return Misshapen("light_weights", shape, num_coefficients);
    }
    const int64_t c = shape[2];
    if (c > 0) {
      Rule rule{SizeOfShape(shape), shape[1] * c, c, std::vector<int64_t>(num_coefficients, -1)};
      for (int64_t i = 0; i < num_coefficients; ++i) {
        const int64_t m = i % (c + 1);
        if (m > 0) {
          rule.column_of[i] = i / (3 * (c + 1)) * c + m - 1;
        }
      }
      result.rules_["light_weights"] = std::move(rule);
    }
  }
  return result;
}

bool CoefficientTables::NeedsEntries(uint32_t coefficient) const {
  return std::ranges::any_of(rules_,
                             [&](const auto& rule) { return rule.second.column_of[coefficient] >= 0; });
}

std::vector<int64_t> CoefficientTables::EntriesOf(const std::string& table,
                                                  std::span<const uint32_t> coefficients,
                                                  std::span<const uint32_t> before) const {
  std::vector<int64_t> entries;
  const auto found = rules_.find(table);
  if (found == rules_.end() || found->second.size == 0) {
    return entries;
  }
  const Rule& rule = found->second;
  std::vector<bool> taken(static_cast<size_t>(rule.size / rule.block * rule.width), false);
  for (const uint32_t coefficient : before) {
    if (rule.column_of[coefficient] >= 0) {
      taken[static_cast<size_t>(rule.column_of[coefficient])] = true;
    }
  }
  for (const uint32_t coefficient : coefficients) {
    const int64_t column = rule.column_of[coefficient];
    if (column < 0 || taken[static_cast<size_t>(column)]) {
      continue;
    }
    taken[static_cast<size_t>(column)] = true;
    const int64_t begin = column / rule.width * rule.block;
    for (int64_t entry = begin + column % rule.width; entry < begin + rule.block; entry += rule.width) {
      entries.push_back(entry);
    }
  }
  return entries;
}

}  // namespace tessera
