#include "btf/stability/stability.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <span>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/codec/diagnosis.h"
#include "btf/data/memory_btf.h"
#include "btf/data/sample_grid.h"
#include "btf/stability/analytic_btf.h"
#include "btf/stability/cases.h"
#include "btf/stability/dsh_orders.h"

namespace tessera {
namespace {

struct DirectionPair {
  Eigen::Vector3d light;
  Eigen::Vector3d view;
};

std::vector<DirectionPair> PairsOf(const StabilityCase& c) {
  std::vector<DirectionPair> pairs;
  for (const Direction& view : c.views) {
    for (const Direction& light : c.lights) {
      pairs.push_back({VectorFromDirection(light), VectorFromDirection(view)});
    }
  }
  return pairs;
}

// Uniform in solid angle, or at one polar angle.
std::vector<DirectionPair> PairsEverywhere(const StabilityCase& c) {
  constexpr int kPairs = 2000;
  Rng rng(11);
  const auto draw = [&] {
    const double z = rng.NextDouble();
    const double phi = 2.0 * kPi * rng.NextDouble();
    return VectorFromDirection({c.decode_theta_rad.value_or(std::acos(z)), phi});
  };
  std::vector<DirectionPair> pairs(kPairs);
  for (DirectionPair& pair : pairs) {
    pair.light = draw();
    pair.view = draw();
  }
  return pairs;
}

double LargestTheta(const std::vector<Direction>& directions) {
  return std::ranges::max(directions, {}, &Direction::theta_rad).theta_rad;
}

// The truth as the format extends it beyond the measured polar angles.
Eigen::Array3d Truth(const StabilityCase& c, int x, int y, const DirectionPair& pair) {
  const auto clamp = [](const Eigen::Vector3d& v, double largest_theta_rad) {
    Direction d = DirectionFromVector(v);
    d.theta_rad = std::min(d.theta_rad, largest_theta_rad);
    return VectorFromDirection(d);
  };
  const Eigen::Vector3d light = clamp(pair.light, LargestTheta(c.lights));
  const Eigen::Vector3d view = clamp(pair.view, LargestTheta(c.views));
  const Eigen::Array3d value =
      c.constant ? Eigen::Array3d::Constant(*c.constant) : AnalyticValue(c.surface, x, y, light, view);
  return value * std::min(1.0, pair.light.z() / light.z());
}

struct Errors {
  double relative = 0.0;
  double largest_value = 0.0;  // decoded, over the largest of the truth
  bool is_finite = true;
};

// Fills [texel][3] with values under one pair.
using DecodeAll = std::function<void(const DirectionPair& pair, std::span<float> rgb)>;

Errors ErrorsAt(const StabilityCase& c, const DecodeAll& decode, const std::vector<DirectionPair>& pairs,
                const RunContext& context) {
  struct Sums {
    double error = 0.0;
    double truth = 0.0;
    double largest = 0.0;
    double largest_truth = 0.0;
    bool is_finite = true;
  };
  const size_t num_texels = static_cast<size_t>(c.surface.width) * c.surface.height;
  std::vector<Sums> by_pair(pairs.size());
  ParallelFor(context, 0, static_cast<int64_t>(pairs.size()), 32, [&](int64_t begin, int64_t end) {
    std::vector<float> rgb(num_texels * 3);
    for (int64_t i = begin; i < end; ++i) {
      decode(pairs[i], rgb);
      Sums& sums = by_pair[i];
      for (size_t texel = 0; texel < num_texels; ++texel) {
        const Eigen::Array3d truth = Truth(c, static_cast<int>(texel) % c.surface.width,
                                           static_cast<int>(texel) / c.surface.width, pairs[i]);
        for (size_t channel = 0; channel < 3; ++channel) {
          const double value = rgb[3 * texel + channel];
          const double wanted = truth[static_cast<Eigen::Index>(channel)];
          sums.is_finite = sums.is_finite && std::isfinite(value);
          sums.error += (value - wanted) * (value - wanted);
          sums.truth += wanted * wanted;
          sums.largest = std::max(sums.largest, value);
          sums.largest_truth = std::max(sums.largest_truth, wanted);
        }
      }
    }
  });
  Sums all;
  for (const Sums& sums : by_pair) {
    all.error += sums.error;
    all.truth += sums.truth;
    all.largest = std::max(all.largest, sums.largest);
    all.largest_truth = std::max(all.largest_truth, sums.largest_truth);
    all.is_finite = all.is_finite && sums.is_finite;
  }
  // An all black truth has no scale of its own.
  constexpr double kSmallestRms = 1e-3;
  const double num_values = 3.0 * static_cast<double>(num_texels * pairs.size());
  const double rms = std::max(std::sqrt(all.truth / num_values), kSmallestRms);
  return {std::sqrt(all.error / num_values) / rms, all.largest / std::max(all.largest_truth, kSmallestRms),
          all.is_finite};
}

DecodeAll UnroundedDecode(const Decoder& decoder, const UnroundedFit& fit) {
  return [&](const DirectionPair& pair, std::span<float> rgb) {
    const LinearForm form = decoder.Form(pair.light, pair.view);
    const size_t k = decoder.num_coefficients();
    for (size_t texel = 0; 3 * texel < rgb.size(); ++texel) {
      Eigen::Array3d value = Eigen::Array3d::Zero();
      const double* weight = form.weights.data();
      for (const LinearForm::Run& run : form.runs) {
        for (int i = run.first; i < run.first + run.count; ++i) {
          value[run.channel] += *weight++ * fit.coefficients[texel * k + i];
        }
      }
      Eigen::Map<Eigen::Array3f>(rgb.data() + 3 * texel) = value.max(0.0).cast<float>();
    }
  };
}

double LargestCoefficient(const BtfelTable& table) {
  constexpr double kLargestCode = 255.0;
  double largest = 0.0;
  for (size_t i = 0; i < table.offset.size(); ++i) {
    largest = std::max({largest, std::abs(static_cast<double>(table.offset[i])),
                        std::abs(table.offset[i] + kLargestCode * table.step[i])});
  }
  return largest;
}

StabilityRow RowOf(const StabilityCase& c, const StabilityMethod& method) {
  StabilityRow row;
  row.stress = c.stress;
  row.method = method.codec;
  row.setting = method.setting;
  row.limit = PromisedLimit(c, method);
  return row;
}

absl::StatusOr<StabilityRow> RunMethod(const StabilityCase& c, MemoryBtf& source,
                                       const StabilityMethod& method, const RunContext& context) {
  StabilityRow row = RowOf(c, method);
  const absl::StatusOr<Material> material = FindCodec(method.codec)->Encode(source, method.params, context);
  if (absl::IsCancelled(material.status())) {
    return material.status();
  }
  if (!material.ok()) {
    row.is_refused = true;
    row.says = std::string(material.status().message());
    row.holds = !row.limit.has_value();
    return row;
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material->btfels));
  TESSERA_ASSIGN_OR_RETURN(const Diagnosis diagnosis, DiagnoseMaterial(source, *material, context));
  const DecodeAll decode = [&](const DirectionPair& pair, std::span<float> rgb) {
    decoder->DecodeTexels(material->btfels.codes, pair.light, pair.view, 0, rgb);
  };
  const Errors measured = ErrorsAt(c, decode, PairsOf(c), context);
  const Errors everywhere = ErrorsAt(c, decode, PairsEverywhere(c), context);
  if (c.methods == MethodSet::kOrders) {
    TESSERA_ASSIGN_OR_RETURN(const UnroundedFit fit, FitUnrounded(source, *material, method.params));
    row.condition = fit.condition;
    row.error_before_quantisation = ErrorsAt(c, UnroundedDecode(*decoder, fit), PairsOf(c), context).relative;
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  row.measured_error = measured.relative;
  row.everywhere_error = everywhere.relative;
  row.largest_value = std::max(measured.largest_value, everywhere.largest_value);
  row.largest_coefficient = LargestCoefficient(material->btfels);
  row.says = absl::StrJoin(diagnosis.warnings, "; ");
  row.holds = measured.is_finite && everywhere.is_finite && row.limit.has_value() &&
              everywhere.relative <= *row.limit;
  return row;
}

absl::StatusOr<std::unique_ptr<MemoryBtf>> SourceOf(const StabilityCase& c) {
  BtfInfo info{.width = c.surface.width, .height = c.surface.height, .views = c.views, .lights = c.lights};
  std::vector<float> samples = AnalyticSamples(c.surface, c.views, c.lights);
  if (c.constant) {
    std::ranges::fill(samples, static_cast<float>(*c.constant));
  }
  if (c.harm) {
    c.harm(info, samples);
  }
  return MemoryBtf::Create(std::move(info), std::move(samples));
}

// Measurements that are no product of views and lights: what the CUReT database holds.
StabilityRow SparsePairsRow() {
  constexpr int kPairs = 205;
  StabilityRow row;
  row.stress = "205 pairs of 205 lights and views";
  row.method = "import";
  std::vector<SampleAngles> samples;
  Rng rng(3);
  for (int i = 0; i < kPairs; ++i) {
    const auto draw = [&] { return AnglesDeg{75.0 * rng.NextDouble(), 360.0 * rng.NextDouble()}; };
    samples.push_back({absl::StrCat("image ", i), draw(), draw()});
  }
  const absl::StatusOr<SampleGrid> grid = BuildSampleGrid(samples);
  row.is_refused = !grid.ok();
  row.says = std::string(grid.status().message());
  row.holds = row.is_refused;
  return row;
}

}  // namespace

absl::StatusOr<std::vector<StabilityRow>> RunStability(const RunContext& context) {
  std::vector<StabilityRow> rows;
  const std::vector<StabilityCase> cases = StabilityCases();
  RunContext quiet = context;
  quiet.progress = nullptr;
  for (size_t i = 0; i < cases.size(); ++i) {
    context.Report("stability", i, cases.size(), "cases");
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<MemoryBtf> source, SourceOf(cases[i]));
    for (const StabilityMethod& method : MethodsOf(cases[i].methods)) {
      TESSERA_ASSIGN_OR_RETURN(StabilityRow row, RunMethod(cases[i], *source, method, quiet));
      rows.push_back(std::move(row));
    }
  }
  rows.push_back(SparsePairsRow());
  context.Report("stability", cases.size(), cases.size(), "cases");
  return rows;
}

}  // namespace tessera
