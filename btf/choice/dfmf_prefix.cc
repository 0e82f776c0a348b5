#include "btf/choice/dfmf_prefix.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/codec/dfmf/rank_choice.h"

namespace tessera {
namespace {

// Columns [0, count) of a table whose last extent is its columns.
CodecTable FirstColumns(const CodecTable& table, int64_t count) {
  CodecTable first{table.shape, {}, table.dtype};
  const auto columns = static_cast<size_t>(table.shape.back());
  first.shape.back() = count;
  for (size_t begin = 0; begin < table.values.size(); begin += columns) {
    first.values.insert(first.values.end(), table.values.begin() + static_cast<std::ptrdiff_t>(begin),
                        table.values.begin() + static_cast<std::ptrdiff_t>(begin) + count);
  }
  return first;
}

int LumaRank(const BtfelTable& table) {
  return static_cast<int>(table.tables.at(kDfmfLuma).shape.back());
}

}  // namespace

DfmfRanks DfmfSplit(const BtfelTable& table, int rank) {
  const auto k = static_cast<size_t>(table.num_coefficients);
  const size_t num_texels = table.size();
  // Factors have unit norm: a component removes the energy of its coefficients.
  std::vector<double> energy(k, 0.0);
  for (size_t texel = 0; texel < num_texels; ++texel) {
    const std::span<const uint8_t> codes = table.btfel(texel);
    for (size_t i = 0; i < k; ++i) {
      const double value = table.offset[i] + static_cast<double>(table.step[i]) * codes[i];
      energy[i] += value * value;
    }
  }
  const CodecTable& factors = table.tables.at(kDfmfLuma);
  const uint64_t factor_bytes =
      table.views.size() * table.lights.size() * (factors.dtype == DType::kU8 ? 1 : 2);
  const auto luma_rank = static_cast<size_t>(LumaRank(table));
  std::vector<ComponentCost> luma;
  std::vector<ComponentCost> chroma;
  for (size_t i = 0; i < k; ++i) {
    if (i < luma_rank) {
      luma.push_back({energy[i], num_texels + factor_bytes});
    } else {
      chroma.push_back({energy[i], num_texels + 2 * factor_bytes});
    }
  }
  const Ranks ranks = ChooseRanks(luma, chroma, std::numeric_limits<double>::max(), 0,
                                  {.max_rank = rank, .max_bytes = std::numeric_limits<uint64_t>::max() / 2});
  return {ranks.luma, ranks.chroma};
}

BtfelTable DfmfPrefix(const BtfelTable& table, const DfmfRanks& ranks, std::span<const size_t> texels) {
  const int luma_rank = LumaRank(table);
  assert(ranks.luma >= 1 && ranks.luma <= luma_rank && ranks.chroma <= table.num_coefficients - luma_rank);
  BtfelTable prefix;
  prefix.codec_id = table.codec_id;
  prefix.codec_version = table.codec_version;
  prefix.num_coefficients = ranks.luma + ranks.chroma;
  prefix.parameters = table.parameters;
  prefix.views = table.views;
  prefix.lights = table.lights;
  for (const auto& [name, values] : table.tables) {
    if (name == kDfmfLuma || name == kDfmfLumaOffset || name == kDfmfLumaStep) {
      prefix.tables[name] = FirstColumns(values, ranks.luma);
    } else if (name == kDfmfChroma || name == kDfmfChromaOffset || name == kDfmfChromaStep) {
      if (ranks.chroma > 0) {
        prefix.tables[name] = FirstColumns(values, ranks.chroma);
      }
    } else {
      prefix.tables[name] = values;
    }
  }
  std::vector<size_t> columns;
  for (int i = 0; i < ranks.luma; ++i) {
    columns.push_back(i);
  }
  for (int i = 0; i < ranks.chroma; ++i) {
    columns.push_back(luma_rank + i);
  }
  for (const size_t column : columns) {
    prefix.offset.push_back(table.offset[column]);
    prefix.step.push_back(table.step[column]);
  }
  std::vector<uint8_t> codes;
  codes.reserve(texels.size() * columns.size());
  for (const size_t texel : texels) {
    const std::span<const uint8_t> of_texel = table.btfel(texel);
    for (const size_t column : columns) {
      codes.push_back(of_texel[column]);
    }
  }
  prefix.codes = std::move(codes);
  return prefix;
}

}  // namespace tessera
