#include "btf/mips/tile_mips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numeric>
#include <optional>
#include <string_view>
#include <unordered_set>
#include <utility>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/quantize.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

constexpr int64_t kTilesTogether = 16;
constexpr size_t kMostBtfels = size_t{1} << 30;  // that PackTexel can name

absl::Status CheckTiles(const TileSet& tile_set) {
  const BtfelTable& table = tile_set.btfels;
  const auto w = static_cast<size_t>(std::max(tile_set.tile_size, 0));
  const auto k = static_cast<size_t>(std::max(table.num_coefficients, 0));
  if (w == 0 || w % 2 != 0 || w > size_t{1} << kMostMipLevels) {
    return absl::InvalidArgumentError(absl::StrCat("tiles of ", w, "x", w,
                                                   " texels have no mip levels: expected an even size up to ",
                                                   1 << kMostMipLevels));
  }
  if (tile_set.tile_index.size() != tile_set.tile_codes.size() * w * w) {
    return absl::InvalidArgumentError(absl::StrCat("the tile set has ", tile_set.tile_index.size(),
                                                   " texels for ", tile_set.tile_codes.size(), " tiles of ",
                                                   w, "x", w));
  }
  if (k == 0 || table.offset.size() != k || table.step.size() != k || table.codes.size() % k != 0) {
    return absl::InvalidArgumentError(absl::StrCat(k, " coefficients with ", table.offset.size(),
                                                   " offsets, ", table.step.size(), " steps and ",
                                                   table.codes.size(), " codes"));
  }
  for (size_t i = 0; i < tile_set.tile_index.size(); ++i) {
    if (BtfelOfTexel(tile_set.tile_index[i]) >= table.size()) {
      return absl::InvalidArgumentError(absl::StrCat("texel ", i, " of the tile set names BTFel ",
                                                     BtfelOfTexel(tile_set.tile_index[i]), " of ",
                                                     table.size()));
    }
  }
  return absl::OkStatus();
}

// Which part of a texel its texels below of each turn go to, and what becomes of their coefficients.
struct Slots {
  std::optional<CoefficientTurns> turns;  // coefficients are turned, and all go to part 0
  std::array<int, 4> of_turn = {0, 0, 0, 0};
  std::vector<int> turn_of = {0};  // [parts]

  [[nodiscard]] size_t size() const { return turn_of.size(); }
};

Slots PartsByTurn(const TileSet& tile_set) {
  std::array<bool, 4> occurs = {};
  for (const uint32_t texel : tile_set.tile_index) {
    occurs[TurnsOfTexel(texel)] = true;
  }
  Slots slots;
  slots.turn_of.clear();
  for (int turn = 0; turn < 4; ++turn) {
    if (occurs[turn]) {
      slots.of_turn[turn] = static_cast<int>(slots.size());
      slots.turn_of.push_back(turn);
    }
  }
  return slots;
}

// The values of the texels of one tile at one level, summed by part.
struct TileSums {
  int side = 0;
  std::vector<float> values;   // [side * side][parts][k]
  std::vector<int> counts;     // [side * side][parts], texels of level 0 in the sum
  std::vector<uint8_t> turns;  // [side * side][parts], of the part
};

// Adds codes [k] to sums [k], dequantised and turned.
class TexelAdder {
 public:
  TexelAdder(const BtfelTable& table, const Slots& slots)
      : table_(table), turns_(slots.turns.has_value() ? &*slots.turns : nullptr) {
    for (int t = 1; t < 4 && turns_ != nullptr; ++t) {
      const CoefficientTurn& turn = (*turns_)[t];
      for (size_t i = 0; i < turn.source.size(); ++i) {
        offset_[t].push_back(turn.sign[i] * table.offset[turn.source[i]]);
        step_[t].push_back(turn.sign[i] * table.step[turn.source[i]]);
      }
    }
  }

  void Add(uint32_t texel, float* sums) const {
    const uint8_t* const codes = table_.btfel(BtfelOfTexel(texel)).data();
    const int t = TurnsOfTexel(texel);
    const size_t k = table_.offset.size();
    if (turns_ == nullptr || t == 0) {
      for (size_t i = 0; i < k; ++i) {
        sums[i] += table_.offset[i] + table_.step[i] * static_cast<float>(codes[i]);
      }
      return;
    }
    const int* const source = (*turns_)[t].source.data();
    for (size_t i = 0; i < k; ++i) {
      sums[i] += offset_[t][i] + step_[t][i] * static_cast<float>(codes[source[i]]);
    }
  }

 private:
  const BtfelTable& table_;
  const CoefficientTurns* turns_;
  std::array<std::vector<float>, 4> offset_;
  std::array<std::vector<float>, 4> step_;
};

void ClearSums(int side, size_t parts, size_t k, TileSums& sums) {
  sums.side = side;
  sums.values.assign(static_cast<size_t>(side) * side * parts * k, 0.0F);
  sums.counts.assign(static_cast<size_t>(side) * side * parts, 0);
}

// Levels 1.. of one tile from its texels; `levels` may hold another tile's.
void SumTile(const TileSet& tile_set, const Slots& slots, const TexelAdder& adder, size_t tile,
             std::vector<TileSums>& levels) {
  const size_t k = tile_set.btfels.offset.size();
  const size_t parts = slots.size();
  const int w = tile_set.tile_size;
  const uint32_t* const texels = tile_set.tile_index.data() + tile * w * w;
  ClearSums(w / 2, parts, k, levels[0]);
  for (int y = 0; y < w; ++y) {
    for (int x = 0; x < w; ++x) {
      const uint32_t texel = texels[static_cast<size_t>(y) * w + x];
      const size_t above =
          (static_cast<size_t>(y / 2) * (w / 2) + x / 2) * parts + slots.of_turn[TurnsOfTexel(texel)];
      adder.Add(texel, levels[0].values.data() + above * k);
      ++levels[0].counts[above];
    }
  }
  for (size_t l = 1; l < levels.size(); ++l) {
    const TileSums& below = levels[l - 1];
    const int side = below.side / 2;
    ClearSums(side, parts, k, levels[l]);
    for (int y = 0; y < below.side; ++y) {
      for (int x = 0; x < below.side; ++x) {
        const size_t from = (static_cast<size_t>(y) * below.side + x) * parts;
        const size_t to = (static_cast<size_t>(y / 2) * side + x / 2) * parts;
        for (size_t i = 0; i < parts * k; ++i) {
          levels[l].values[to * k + i] += below.values[from * k + i];
        }
        for (size_t part = 0; part < parts; ++part) {
          levels[l].counts[to + part] += below.counts[from + part];
        }
      }
    }
  }
}

// Sums become means, where there are any.
void DivideByCounts(size_t k, TileSums& sums) {
  for (size_t part = 0; part < sums.counts.size(); ++part) {
    if (sums.counts[part] > 1) {
      const float share = 1.0F / static_cast<float>(sums.counts[part]);
      for (size_t i = 0; i < k; ++i) {
        sums.values[part * k + i] *= share;
      }
    }
  }
}

// Larger blocks hardly ever come back elsewhere.
constexpr int kMostSharedBlock = 8;

// The turns that a block of texels has in common with the first of those that differ from it by turns alone:
// turned back by them, all of these have the same mean.
int CommonTurns(std::span<const uint32_t> block) {
  std::vector<uint32_t> least;
  int common = 0;
  for (int turns = 0; turns < 4; ++turns) {
    std::vector<uint32_t> turned_back;
    for (const uint32_t texel : block) {
      turned_back.push_back(PackTexel(BtfelOfTexel(texel), TurnsOfTexel(texel) - turns));
    }
    std::ranges::sort(turned_back);
    if (least.empty() || turned_back < least) {
      least = std::move(turned_back);
      common = turns;
    }
  }
  return common;
}

// Parts get their turns: those of their texels or, where coefficients can be turned, what equal blocks have
// in common.
void AssignTurns(const TileSet& tile_set, const Slots& slots, size_t tile, TileSums& means) {
  const size_t k = tile_set.btfels.offset.size();
  const int w = tile_set.tile_size;
  const int side = means.side;
  const int block = w / side;
  means.turns.clear();
  std::vector<float> turned_back(k);
  std::vector<uint32_t> texels;
  for (int i = 0; i < side * side; ++i) {
    if (!slots.turns.has_value() || block > kMostSharedBlock) {
      means.turns.insert(means.turns.end(), slots.turn_of.begin(), slots.turn_of.end());
      continue;
    }
    texels.clear();
    for (int j = 0; j < block * block; ++j) {
      texels.push_back(
          tile_set.texel(static_cast<int>(tile), i % side * block + j % block, i / side * block + j / block));
    }
    const int turns = CommonTurns(texels);
    means.turns.push_back(static_cast<uint8_t>(turns));
    if (turns != 0) {
      const CoefficientTurn& back = (*slots.turns)[4 - turns];
      float* const values = means.values.data() + i * k;
      for (size_t c = 0; c < k; ++c) {
        turned_back[c] = back.sign[c] * values[back.source[c]];
      }
      std::ranges::copy(turned_back, values);
    }
  }
}

// Smallest and largest mean of each coefficient.
struct Range {
  explicit Range(size_t k) : low(k, INFINITY), high(k, -INFINITY) {}

  void Add(const TileSums& means) {
    const size_t k = low.size();
    for (size_t part = 0; part < means.counts.size(); ++part) {
      const float* const values = means.values.data() + part * k;
      for (size_t i = 0; i < k && means.counts[part] > 0; ++i) {
        low[i] = std::min(low[i], values[i]);
        high[i] = std::max(high[i], values[i]);
      }
    }
  }
  void Add(const Range& other) {
    for (size_t i = 0; i < low.size(); ++i) {
      low[i] = std::min(low[i], other.low[i]);
      high[i] = std::max(high[i], other.high[i]);
    }
  }

  std::vector<float> low;
  std::vector<float> high;
};

// What quantisation does to reflectance, under a few directions.
class MipErrorMeter {
 public:
  MipErrorMeter(const BtfelTable& table, const Decoder& decoder) {
    for (size_t pair = 0; pair < kMipErrorPairs; ++pair) {
      // Odd sixteenths of the views, each once, with odd sixteenths of the lights in another order.
      const size_t at = 2 * pair + 1;
      const auto pick = [](const std::vector<Direction>& from, size_t sixteenth) {
        return VectorFromDirection(from[sixteenth * from.size() / 16]);
      };
      const Eigen::Vector3d view = pick(table.views, at);
      const Eigen::Vector3d light = pick(table.lights, at * 5 % 16);
      for (int t = 0; t < 4; ++t) {
        forms_[pair][t] = decoder.Form(UnturnedFromTurned(light, t), UnturnedFromTurned(view, t));
      }
    }
  }

  struct Sum {
    double squares = 0.0;
    int64_t samples = 0;
  };

  // One texel exact and quantised, [parts][k] each; parts of count 0 are not read.
  void Add(std::span<const int> counts, std::span<const uint8_t> turns, std::span<const float> exact,
           std::span<const float> quantised, Sum& sum) const {
    const size_t k = exact.size() / counts.size();
    const double total = std::accumulate(counts.begin(), counts.end(), 0.0);
    std::vector<double> values(k);
    std::vector<double> coded(k);
    std::array<Eigen::Array3d, kMipErrorPairs> exact_rgb;
    std::array<Eigen::Array3d, kMipErrorPairs> coded_rgb;
    exact_rgb.fill(Eigen::Array3d::Zero());
    coded_rgb = exact_rgb;
    for (size_t part = 0; part < counts.size(); ++part) {
      if (counts[part] > 0) {
        std::copy_n(exact.begin() + static_cast<ptrdiff_t>(part * k), k, values.begin());
        std::copy_n(quantised.begin() + static_cast<ptrdiff_t>(part * k), k, coded.begin());
        for (size_t pair = 0; pair < kMipErrorPairs; ++pair) {
          const LinearForm& form = forms_[pair][turns[part]];
          exact_rgb[pair] += counts[part] / total * form.ValueOf(values);
          coded_rgb[pair] += counts[part] / total * form.ValueOf(coded);
        }
      }
    }
    for (size_t pair = 0; pair < kMipErrorPairs; ++pair) {
      sum.squares += (exact_rgb[pair].max(0.0) - coded_rgb[pair].max(0.0)).square().sum();
      sum.samples += 3;
    }
  }

 private:
  std::array<std::array<LinearForm, 4>, kMipErrorPairs> forms_;
};

// One tile at one level, quantised.
struct TileCodes {
  std::vector<uint8_t> codes;  // [side * side][parts][k]
  std::vector<int> counts;     // [side * side][parts]
  std::vector<uint8_t> turns;  // likewise
  MipErrorMeter::Sum error;
};

// A level as it grows tile by tile; equal BTFels are kept once.
class LevelBuilder {
 public:
  LevelBuilder(int tile_size, size_t k, Quantisation quantisation)
      : k_(k), quantisation_(std::move(quantisation)), known_(0, Hash{this}, Equal{this}) {
    level_.tile_size = tile_size;
  }
  LevelBuilder(const LevelBuilder&) = delete;
  LevelBuilder& operator=(const LevelBuilder&) = delete;

  void Append(size_t parts, const TileCodes& tile) {
    const auto all = static_cast<float>(
        std::accumulate(tile.counts.begin(), tile.counts.begin() + static_cast<ptrdiff_t>(parts), 0));
    for (size_t part = 0; part < tile.counts.size(); ++part) {
      if (tile.counts[part] == 0) {
        level_.parts.push_back({});
        continue;
      }
      const auto codes = tile.codes.begin() + static_cast<ptrdiff_t>(part * k_);
      codes_.insert(codes_.end(), codes, codes + static_cast<ptrdiff_t>(k_));
      const auto last = static_cast<uint32_t>(codes_.size() / k_ - 1);
      const auto [found, is_new] = known_.insert(last);
      if (!is_new) {
        codes_.resize(last * k_);
      }
      level_.parts.push_back(
          {PackTexel(*found, tile.turns[part]), static_cast<float>(tile.counts[part]) / all});
    }
    error_.squares += tile.error.squares;
    error_.samples += tile.error.samples;
  }

  [[nodiscard]] const Quantisation& quantisation() const { return quantisation_; }
  [[nodiscard]] uint64_t size_bytes() const { return codes_.size() + level_.parts.size() * sizeof(MipPart); }
  [[nodiscard]] size_t num_btfels() const { return codes_.size() / k_; }

  // All but the codes of the table come from `table`.
  [[nodiscard]] MipLevel Finish(const BtfelTable& table) {
    BtfelTable& btfels = level_.btfels;
    btfels.codec_id = table.codec_id;
    btfels.codec_version = table.codec_version;
    btfels.num_coefficients = table.num_coefficients;
    btfels.offset = quantisation_.offset;
    btfels.step = quantisation_.step;
    btfels.tables = table.tables;
    btfels.parameters = table.parameters;
    btfels.views = table.views;
    btfels.lights = table.lights;
    codes_.shrink_to_fit();
    btfels.codes = std::move(codes_);
    level_.quantisation_rmse =
        error_.samples > 0 ? std::sqrt(error_.squares / static_cast<double>(error_.samples)) : 0.0;
    return std::move(level_);
  }

 private:
  [[nodiscard]] std::string_view Bytes(uint32_t btfel) const {
    return {reinterpret_cast<const char*>(codes_.data()) + btfel * k_, k_};
  }
  struct Hash {
    const LevelBuilder* builder;
    size_t operator()(uint32_t btfel) const { return std::hash<std::string_view>()(builder->Bytes(btfel)); }
  };
  struct Equal {
    const LevelBuilder* builder;
    bool operator()(uint32_t a, uint32_t b) const { return builder->Bytes(a) == builder->Bytes(b); }
  };

  size_t k_;
  Quantisation quantisation_;
  MipLevel level_;
  std::vector<uint8_t> codes_;
  std::unordered_set<uint32_t, Hash, Equal> known_;
  MipErrorMeter::Sum error_;
};

// The two passes over the tiles.
class MipMaker {
 public:
  MipMaker(const TileSet& tile_set, const Slots& slots, const Decoder& decoder, const RunContext& context)
      : tile_set_(tile_set),
        slots_(slots),
        context_(context),
        adder_(tile_set.btfels, slots),
        meter_(tile_set.btfels, decoder),
        num_tiles_(static_cast<int64_t>(tile_set.tile_codes.size())) {
    for (int side = tile_set.tile_size; side % 2 == 0; side /= 2) {
      ++num_levels_;
    }
  }

  [[nodiscard]] absl::StatusOr<TileMips> Make(const MipParams& params) {
    TESSERA_ASSIGN_OR_RETURN(std::vector<Quantisation> quantisations, Quantisations());
    std::vector<std::unique_ptr<LevelBuilder>> builders;
    for (size_t l = 0; l < num_levels_; ++l) {
      builders.push_back(
          std::make_unique<LevelBuilder>(tile_set_.tile_size >> (l + 1), k(), std::move(quantisations[l])));
    }
    std::vector<std::vector<TileCodes>> tiles(kTilesTogether);
    for (int64_t first = 0; first < num_tiles_; first += kTilesTogether) {
      const int64_t end = std::min(first + kTilesTogether, num_tiles_);
      ForTiles(first, end, [&](int64_t tile, std::vector<TileSums>& means) {
        tiles[tile - first] = Quantised(tile, means, builders);
      });
      TESSERA_RETURN_IF_ERROR(context_.CheckStop());
      for (int64_t tile = first; tile < end; ++tile) {
        uint64_t bytes = 0;
        for (size_t l = 0; l < num_levels_; ++l) {
          builders[l]->Append(slots_.size(), tiles[tile - first][l]);
          bytes += builders[l]->size_bytes();
        }
        if (bytes > params.max_bytes || builders[0]->num_btfels() > kMostBtfels) {
          return absl::ResourceExhaustedError(absl::StrCat("mip levels of ", tile + 1, " of ", num_tiles_,
                                                           " tiles take ", bytes, " bytes, at most ",
                                                           params.max_bytes, " are allowed"));
        }
      }
      Report();
    }
    TileMips mips{.parts_per_texel = static_cast<int>(slots_.size()), .levels = {}};
    for (const std::unique_ptr<LevelBuilder>& builder : builders) {
      mips.levels.push_back(builder->Finish(tile_set_.btfels));
    }
    return mips;
  }

 private:
  [[nodiscard]] size_t k() const { return tile_set_.btfels.offset.size(); }

  // body(tile, means of its levels) for the tiles [first, end).
  void ForTiles(int64_t first, int64_t end,
                const std::function<void(int64_t tile, std::vector<TileSums>& means)>& body) const {
    ParallelFor(context_, first, end, 1, [&](int64_t begin, int64_t last) {
      for (int64_t tile = begin; tile < last; ++tile) {
        std::vector<TileSums> levels(num_levels_);
        SumTile(tile_set_, slots_, adder_, static_cast<size_t>(tile), levels);
        for (TileSums& level : levels) {
          DivideByCounts(k(), level);
          AssignTurns(tile_set_, slots_, static_cast<size_t>(tile), level);
        }
        body(tile, levels);
      }
    });
  }

  // Of each level.
  [[nodiscard]] absl::StatusOr<std::vector<Quantisation>> Quantisations() {
    const BtfelTable& table = tile_set_.btfels;
    if (!slots_.turns.has_value()) {
      passes_ = 1;
      return std::vector<Quantisation>(num_levels_, {table.offset, table.step});
    }
    std::vector<Range> ranges(num_levels_, Range(k()));
    for (int64_t first = 0; first < num_tiles_; first += kTilesTogether) {
      const int64_t end = std::min(first + kTilesTogether, num_tiles_);
      std::vector<std::vector<Range>> of_tiles(end - first);
      ForTiles(first, end, [&](int64_t tile, std::vector<TileSums>& means) {
        for (const TileSums& level : means) {
          of_tiles[tile - first].emplace_back(k()).Add(level);
        }
      });
      TESSERA_RETURN_IF_ERROR(context_.CheckStop());
      for (const std::vector<Range>& of_tile : of_tiles) {
        for (size_t l = 0; l < num_levels_; ++l) {
          ranges[l].Add(of_tile[l]);
        }
      }
      Report();
    }
    std::vector<Quantisation> quantisations;
    for (const Range& range : ranges) {
      quantisations.push_back(UniformQuantisation(range.low, range.high));
    }
    return quantisations;
  }

  // Each level of a tile.
  [[nodiscard]] std::vector<TileCodes> Quantised(
      int64_t tile, const std::vector<TileSums>& means,
      const std::vector<std::unique_ptr<LevelBuilder>>& builders) const {
    std::vector<TileCodes> result(means.size());
    for (size_t l = 0; l < means.size(); ++l) {
      const Quantisation& quantisation = builders[l]->quantisation();
      result[l].counts = means[l].counts;
      result[l].turns = means[l].turns;
      result[l].codes.resize(means[l].values.size());
      Quantize(quantisation, means[l].values, result[l].codes);
      const auto texels = static_cast<int64_t>(means[l].side) * means[l].side;
      const int64_t stride = (num_tiles_ * texels + kMipErrorTexels - 1) / kMipErrorTexels;
      // Texels are counted on from tile to tile.
      for (int64_t t = (stride - tile * texels % stride) % stride; t < texels; t += stride) {
        AddError(means[l], quantisation, static_cast<size_t>(t), result[l]);
      }
    }
    return result;
  }

  void AddError(const TileSums& means, const Quantisation& quantisation, size_t texel,
                TileCodes& tile) const {
    const size_t size = slots_.size() * k();
    std::vector<float> quantised(size);
    for (size_t i = 0; i < size; ++i) {
      quantised[i] = quantisation.offset[i % k()] +
                     quantisation.step[i % k()] * static_cast<float>(tile.codes[texel * size + i]);
    }
    const auto parts_of = [&](const auto& all) {
      return std::span(all).subspan(texel * slots_.size(), slots_.size());
    };
    meter_.Add(parts_of(means.counts), parts_of(means.turns),
               std::span(means.values).subspan(texel * size, size), quantised, tile.error);
  }

  // One more pass over kTilesTogether tiles is done.
  void Report() {
    done_ =
        std::min(done_ + static_cast<uint64_t>(kTilesTogether), static_cast<uint64_t>(num_tiles_ * passes_));
    context_.Report("mips", done_ / passes_, num_tiles_, "tiles");
  }

  const TileSet& tile_set_;
  const Slots& slots_;
  const RunContext& context_;
  TexelAdder adder_;
  MipErrorMeter meter_;
  int64_t num_tiles_;
  size_t num_levels_ = 0;
  int passes_ = 2;
  uint64_t done_ = 0;
};

}  // namespace

uint64_t TileMips::size_bytes() const {
  uint64_t bytes = 0;
  for (const MipLevel& level : levels) {
    bytes += level.size_bytes();
  }
  return bytes;
}

absl::StatusOr<TileMips> MakeTileMips(const TileSet& tile_set, const MipParams& params,
                                      const RunContext& context) {
  const Codec* const codec = FindCodec(tile_set.btfels.codec_id);
  if (codec == nullptr) {
    return absl::UnimplementedError(absl::StrCat("codec ", tile_set.btfels.codec_id, " is not known here"));
  }
  TESSERA_RETURN_IF_ERROR(CheckTiles(tile_set));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(tile_set.btfels));
  TESSERA_ASSIGN_OR_RETURN(std::optional<CoefficientTurns> turns, codec->Turns(tile_set.btfels));
  Slots slots;
  if (turns.has_value()) {
    slots.turns = std::move(turns);
  } else {
    slots = PartsByTurn(tile_set);
  }
  return MipMaker(tile_set, slots, *decoder, context).Make(params);
}

}  // namespace tessera
