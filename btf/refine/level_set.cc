#include "btf/refine/level_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>

#include <absl/strings/str_cat.h>
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/codec/quantize.h"
#include "btf/math/conventions.h"
#include "btf/mips/tile_mips.h"
#include "btf/wang/scene_needs.h"

namespace tessera {
namespace {

constexpr uint64_t kMostMipBytes = uint64_t{1} << 30;
// Relative to the mean eigenvalue: what directions do not determine stays small.
constexpr double kTurnRidge = 1e-6;
constexpr size_t kErrorTexels = 1024;
constexpr size_t kErrorPairs = 8;

using Pair = std::pair<Eigen::Vector3d, Eigen::Vector3d>;  // light, view

// Each measured view with kTurnLights lights, another first one for each.
std::vector<Pair> TurnPairs(const BtfelTable& table) {
  std::vector<Pair> pairs;
  const size_t lights = std::min(table.lights.size(), static_cast<size_t>(kTurnLights));
  for (size_t view = 0; view < table.views.size(); ++view) {
    for (size_t i = 0; i < lights; ++i) {
      const size_t light = (i * table.lights.size() / lights + view) % table.lights.size();
      pairs.emplace_back(VectorFromDirection(table.lights[light]), VectorFromDirection(table.views[view]));
    }
  }
  return pairs;
}

// [3][k], of a BTFel that is turned by `turns`, in the frame of the pair.
Eigen::MatrixXd RowsOf(const Decoder& decoder, const Pair& pair, int turns) {
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(3, decoder.num_coefficients());
  const LinearForm form =
      decoder.Form(UnturnedFromTurned(pair.first, turns), UnturnedFromTurned(pair.second, turns));
  const double* weight = form.weights.data();
  for (const LinearForm::Run& run : form.runs) {
    for (int i = run.first; i < run.first + run.count; ++i) {
      rows(run.channel, i) += *weight++;
    }
  }
  return rows;
}

// [turns 1..3]: what turns coefficients by so many quarter turns, as nearly as the codec can.
absl::StatusOr<std::array<Eigen::MatrixXd, 4>> TurnMatrices(const Decoder& decoder, const BtfelTable& table,
                                                            const RunContext& context) {
  const int k = table.num_coefficients;
  if (k > kMostTurnedCoefficients) {
    return absl::ResourceExhaustedError(absl::StrCat("a level of ", k, " coefficients of codec ",
                                                     table.codec_id, ", which cannot turn them: at most ",
                                                     kMostTurnedCoefficients));
  }
  const std::vector<Pair> pairs = TurnPairs(table);
  std::array<Eigen::MatrixXd, 4> rows;
  for (int turns = 0; turns < 4; ++turns) {
    rows[turns].resize(3 * static_cast<Eigen::Index>(pairs.size()), k);
    for (size_t i = 0; i < pairs.size(); ++i) {
      rows[turns].middleRows<3>(3 * static_cast<Eigen::Index>(i)) = RowsOf(decoder, pairs[i], turns);
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(k, k);
  normal.selfadjointView<Eigen::Lower>().rankUpdate(rows[0].transpose());
  normal.diagonal().array() += std::max(kTurnRidge * normal.trace() / k, 1e-30);
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal.selfadjointView<Eigen::Lower>());
  std::array<Eigen::MatrixXd, 4> matrices;
  for (int turns = 1; turns < 4; ++turns) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    matrices[turns] = solver.solve(rows[0].transpose() * rows[turns]);
  }
  return matrices;
}

Eigen::VectorXd ValuesOf(const BtfelTable& table, uint32_t btfel) {
  Eigen::VectorXd values(table.num_coefficients);
  const auto codes = table.btfel(btfel);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    values[i] = table.offset[i] + static_cast<double>(table.step[i]) * codes[static_cast<size_t>(i)];
  }
  return values;
}

// One texel of the level from its parts: coefficients, and the turn that they have.
std::pair<Eigen::VectorXd, int> Joined(const BtfelTable& table, std::span<const MipPart> parts,
                                       const std::array<Eigen::MatrixXd, 4>& turns) {
  const MipPart& largest = *std::ranges::max_element(
      parts, [](const MipPart& a, const MipPart& b) { return a.weight < b.weight; });
  const int turn = TurnsOfTexel(largest.texel);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(table.num_coefficients);
  for (const MipPart& part : parts) {
    if (part.weight > 0.0F) {
      const int further = (TurnsOfTexel(part.texel) - turn) & 3;
      const Eigen::VectorXd values = ValuesOf(table, BtfelOfTexel(part.texel));
      sum += part.weight * (further == 0 ? values : turns[further] * values);
    }
  }
  return {std::move(sum), turn};
}

// Quantised, with a range of its own.
absl::Status JoinParts(const MipLevel& level, int parts_per_texel,
                       const std::array<Eigen::MatrixXd, 4>& turns, const RunContext& context,
                       TileSet& joined) {
  const auto k = static_cast<size_t>(level.btfels.num_coefficients);
  const size_t num_texels = level.parts.size() / parts_per_texel;
  std::vector<float> values(num_texels * k);
  std::vector<float> low(k, INFINITY);
  std::vector<float> high(k, -INFINITY);
  joined.tile_index.resize(num_texels);
  for (size_t texel = 0; texel < num_texels; ++texel) {
    if (texel % 256 == 0) {
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
    }
    const auto parts = std::span(level.parts).subspan(texel * parts_per_texel, parts_per_texel);
    const auto [sum, turn] = Joined(level.btfels, parts, turns);
    for (size_t i = 0; i < k; ++i) {
      const auto value = static_cast<float>(sum[static_cast<Eigen::Index>(i)]);
      values[texel * k + i] = value;
      low[i] = std::min(low[i], value);
      high[i] = std::max(high[i], value);
    }
    joined.tile_index[texel] = PackTexel(static_cast<uint32_t>(texel), turn);
  }
  Quantisation quantisation = UniformQuantisation(low, high);
  joined.btfels.codes.assign(values.size(), 0);
  Quantize(quantisation, values, joined.btfels.codes);
  joined.btfels.offset = std::move(quantisation.offset);
  joined.btfels.step = std::move(quantisation.step);
  return absl::OkStatus();
}

double RmseAgainst(const MipLevel& level, int parts_per_texel, const Decoder& parts_decoder,
                   const TileSet& joined, const Decoder& decoder) {
  const BtfelTable& table = level.btfels;
  double squares = 0.0;
  size_t samples = 0;
  const size_t stride = (joined.tile_index.size() + kErrorTexels - 1) / kErrorTexels;
  for (size_t pair = 0; pair < kErrorPairs; ++pair) {
    const size_t at = 2 * pair + 1;
    const Eigen::Vector3d view = VectorFromDirection(table.views[at * table.views.size() / 16]);
    const Eigen::Vector3d light = VectorFromDirection(table.lights[at * 5 % 16 * table.lights.size() / 16]);
    std::array<LinearForm, 4> of_parts;
    std::array<LinearForm, 4> of_joined;
    for (int t = 0; t < 4; ++t) {
      of_parts[t] = parts_decoder.Form(UnturnedFromTurned(light, t), UnturnedFromTurned(view, t));
      of_joined[t] = decoder.Form(UnturnedFromTurned(light, t), UnturnedFromTurned(view, t));
    }
    const auto value_of = [](const LinearForm& form, const Eigen::VectorXd& values) {
      return form.ValueOf(std::span(values.data(), static_cast<size_t>(values.size())));
    };
    for (size_t texel = 0; texel < joined.tile_index.size(); texel += stride) {
      Eigen::Array3d exact = Eigen::Array3d::Zero();
      for (const MipPart& part : std::span(level.parts).subspan(texel * parts_per_texel, parts_per_texel)) {
        if (part.weight > 0.0F) {
          exact += part.weight *
                   value_of(of_parts[TurnsOfTexel(part.texel)], ValuesOf(table, BtfelOfTexel(part.texel)));
        }
      }
      const uint32_t packed = joined.tile_index[texel];
      const Eigen::Array3d got =
          value_of(of_joined[TurnsOfTexel(packed)], ValuesOf(joined.btfels, BtfelOfTexel(packed)));
      squares += (exact.max(0.0) - got.max(0.0)).square().sum();
      samples += 3;
    }
  }
  return samples == 0 ? 0.0 : std::sqrt(squares / static_cast<double>(samples));
}

}  // namespace

absl::StatusOr<LevelSet> MakeLevelSet(const TileSet& tile_set, int level, const RunContext& context) {
  if (const int last = LastMipLevel(tile_set.tile_size); level < 1 || level > last) {
    return absl::InvalidArgumentError(absl::StrCat("level ", level, ": tiles of ", tile_set.tile_size, "x",
                                                   tile_set.tile_size, " texels have levels 1 to ", last));
  }
  TESSERA_ASSIGN_OR_RETURN(TileMips mips, MakeTileMips(tile_set, {.max_bytes = kMostMipBytes}, context));
  MipLevel& from = mips.levels[static_cast<size_t>(level) - 1];
  LevelSet result;
  TileSet& far = result.tile_set;
  far.arrangement_id = tile_set.arrangement_id;
  far.arrangement_sha256 = tile_set.arrangement_sha256;
  far.tile_size = from.tile_size;
  far.strip_height = std::max(tile_set.strip_height >> level, 1);
  far.tile_codes = tile_set.tile_codes;
  far.provenance = tile_set.provenance;
  far.radiometry = tile_set.radiometry;
  if (mips.parts_per_texel == 1) {
    far.btfels = from.btfels.WithoutCodes();
    if (from.parts.size() > kMostMipBytes / from.btfels.num_coefficients) {
      return absl::ResourceExhaustedError(absl::StrCat("a level of ", from.parts.size(), " texels of ",
                                                       from.btfels.num_coefficients,
                                                       " coefficients: at most ", kMostMipBytes, " bytes"));
    }
    std::vector<uint8_t> codes;
    codes.reserve(from.parts.size() * from.btfels.num_coefficients);
    for (const MipPart& part : from.parts) {
      const auto btfel = from.btfels.btfel(BtfelOfTexel(part.texel));
      far.tile_index.push_back(
          PackTexel(static_cast<uint32_t>(far.tile_index.size()), TurnsOfTexel(part.texel)));
      codes.insert(codes.end(), btfel.begin(), btfel.end());
    }
    far.btfels.codes = CodeBuffer(std::move(codes));
    result.rmse = from.quantisation_rmse;
    return result;
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> parts_decoder, MakeDecoder(from.btfels));
  TESSERA_ASSIGN_OR_RETURN(const auto turns, TurnMatrices(*parts_decoder, from.btfels, context));
  far.btfels = from.btfels.WithoutCodes();
  TESSERA_RETURN_IF_ERROR(JoinParts(from, mips.parts_per_texel, turns, context, far));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(far.btfels));
  result.rmse = RmseAgainst(from, mips.parts_per_texel, *parts_decoder, far, *decoder);
  return result;
}

}  // namespace tessera
