#include "btf/codec/view_pca/view_pca_encoder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_store.h"
#include "btf/codec/encoder_input.h"
#include "btf/codec/quantize.h"
#include "btf/codec/row_passes.h"
#include "btf/codec/view_pca/view_pca_decoder.h"
#include "btf/math/hemisphere_triangulation.h"

namespace tessera {
namespace {

struct Sizes {
  Eigen::Index num_views = 0;
  Eigen::Index num_lights = 0;
  Eigen::Index signals_per_row = 0;  // of one view: texels and channels

  explicit Sizes(const BtfInfo& info)
      : num_views(static_cast<Eigen::Index>(info.views.size())),
        num_lights(static_cast<Eigen::Index>(info.lights.size())),
        signals_per_row(Eigen::Index{3} * info.width) {}
};

// One row of one view, centred over the lights.
struct RowOfView {
  Eigen::MatrixXf samples;  // [lights][signals]
  Eigen::RowVectorXf mean;  // [signals]

  // `row` in ReadRows' layout. False when a sample is illegal. The sums do not depend on where `row` lies:
  // they are formed in this object's own memory.
  bool Gather(const Sizes& sizes, const float* row, Eigen::Index view) {
    samples.resize(sizes.num_lights, sizes.signals_per_row);
    for (Eigen::Index s = 0; s < sizes.signals_per_row; ++s) {
      std::copy_n(row + (s * sizes.num_views + view) * sizes.num_lights, sizes.num_lights,
                  samples.col(s).data());
    }
    // One look at the sum clears almost every row; NaN fails every comparison.
    if (!(samples.squaredNorm() <= kLargestSample * kLargestSample) &&
        !std::all_of(samples.data(), samples.data() + samples.size(), IsLegalSample)) {
      return false;
    }
    mean = samples.colwise().mean();
    samples.rowwise() -= mean;
    return true;
  }
};

// Sums over texels and channels of x x^T, x centred over the lights: [view] of [lights][lights], lower
// triangle. Each view is summed by one task, row after row in float, rows in double.
absl::StatusOr<std::vector<Eigen::MatrixXd>> Covariances(const BtfInfo& info, RowPasses& passes,
                                                         const RunContext& context) {
  const Sizes sizes(info);
  std::vector<Eigen::MatrixXd> sums(sizes.num_views,
                                    Eigen::MatrixXd::Zero(sizes.num_lights, sizes.num_lights));
  const size_t row_samples = static_cast<size_t>(sizes.signals_per_row * sizes.num_views * sizes.num_lights);
  TESSERA_RETURN_IF_ERROR(passes.Run([&](const SampleBlock& block) {
    std::atomic<bool> is_legal = true;
    ParallelFor(context, 0, sizes.num_views, 1, [&](int64_t begin, int64_t end) {
      RowOfView row;
      Eigen::MatrixXf products(sizes.num_lights, sizes.num_lights);
      for (int64_t view = begin; view < end; ++view) {
        for (int r = 0; r < block.num_rows; ++r) {
          if (!row.Gather(sizes, block.samples.data() + r * row_samples, view)) {
            is_legal = false;
            return;
          }
          products.setZero();
          products.selfadjointView<Eigen::Lower>().rankUpdate(row.samples);
          sums[view] += products.cast<double>();
        }
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    return is_legal ? absl::OkStatus() : IllegalSampleError(info, block.row, block.samples);
  }));
  return sums;
}

struct ViewBases {
  std::vector<Eigen::MatrixXf> weights;  // [view] of [lights][c], orthonormal columns
  double captured_share = 1.0;           // of the variance over the lights, all views
};

ViewBases LeadingEigenvectors(const std::vector<Eigen::MatrixXd>& covariances, Eigen::Index c,
                              const RunContext& context) {
  ViewBases bases;
  bases.weights.resize(covariances.size());
  std::vector<double> kept(covariances.size());
  std::vector<double> total(covariances.size());
  ParallelFor(context, 0, static_cast<int64_t>(covariances.size()), 1, [&](int64_t begin, int64_t end) {
    for (int64_t view = begin; view < end; ++view) {
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariances[view]);  // reads the lower half
      Eigen::MatrixXd vectors = eigen.eigenvectors().rowwise().reverse().leftCols(c);
      for (Eigen::Index i = 0; i < c; ++i) {
        Eigen::Index largest = 0;
        vectors.col(i).cwiseAbs().maxCoeff(&largest);
        if (vectors(largest, i) < 0.0) {
          vectors.col(i) *= -1.0;
        }
      }
      bases.weights[view] = vectors.cast<float>();
      kept[view] = eigen.eigenvalues().tail(c).cwiseMax(0.0).sum();
      total[view] = covariances[view].trace();
    }
  });
  // One after the other: a library would cut the sums by where the vectors lie.
  const double sum_kept = std::accumulate(kept.begin(), kept.end(), 0.0);
  const double sum_total = std::accumulate(total.begin(), total.end(), 0.0);
  if (sum_total > 0.0) {
    bases.captured_share = std::min(1.0, sum_kept / sum_total);
  }
  return bases;
}

struct Ranges {
  std::vector<float> minima;
  std::vector<float> maxima;
};

// Means and eigen-textures of one row of one view, into coefficients [x][k].
void ProjectRow(const RowOfView& row, const Eigen::MatrixXf& weights, Eigen::Index view, Eigen::Index k,
                Eigen::MatrixXf& scratch, float* coefficients, Ranges& ranges) {
  const Eigen::Index run = weights.cols() + 1;
  scratch.resize(run, row.mean.size());
  scratch.row(0) = row.mean;
  scratch.bottomRows(run - 1).noalias() = weights.transpose() * row.samples;
  for (Eigen::Index s = 0; s < row.mean.size(); ++s) {
    const Eigen::Index first = (view * 3 + s % 3) * run;
    float* const out = coefficients + s / 3 * k + first;
    for (Eigen::Index m = 0; m < run; ++m) {
      const float value = scratch(m, s);
      out[m] = value;
      ranges.minima[first + m] = std::min(ranges.minima[first + m], value);
      ranges.maxima[first + m] = std::max(ranges.maxima[first + m], value);
    }
  }
}

CodecTable WeightTable(const ViewBases& bases, Eigen::Index num_lights, Eigen::Index c) {
  CodecTable table{{static_cast<int64_t>(bases.weights.size()), num_lights, c}, {}, DType::kU16};
  for (const Eigen::MatrixXf& weights : bases.weights) {
    for (Eigen::Index light = 0; light < num_lights; ++light) {
      for (Eigen::Index m = 0; m < c; ++m) {
        table.values.push_back(std::round(std::clamp(weights(light, m), -1.0F, 1.0F) * kZeroWeight) +
                               kZeroWeight);
      }
    }
  }
  return table;
}

// Triangles of the directions as a reader finds them, rounded to float32.
CodecTable TriangleTable(const std::vector<Direction>& directions) {
  std::vector<Direction> stored;
  for (const Direction& direction : directions) {
    stored.push_back(DirectionFromVector(VectorFromDirection(direction).cast<float>().cast<double>()));
  }
  const std::vector<DirectionTriangle> triangles = TriangulateHemisphere(stored);
  CodecTable table{{static_cast<int64_t>(triangles.size()), 3}, {}, DType::kU16};
  for (const DirectionTriangle& triangle : triangles) {
    table.values.insert(table.values.end(), triangle.begin(), triangle.end());
  }
  return table;
}

absl::Status CheckInput(const BtfInfo& info, const EncodeParams& params) {
  if (params.eigen_textures < 1 || params.eigen_textures > kMaxEigenTextures) {
    return absl::InvalidArgumentError(absl::StrCat("eigen_textures = ", params.eigen_textures,
                                                   ": legal values are 1 to ", kMaxEigenTextures));
  }
  return CheckEncoderInput(info, kMaxViewPcaDirections);
}

}  // namespace

absl::StatusOr<Material> EncodeViewPca(BtfSource& source, const EncodeParams& params,
                                       const RunContext& context) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckInput(info, params));
  const Sizes sizes(info);
  const Eigen::Index c = std::min<Eigen::Index>(params.eigen_textures, sizes.num_lights - 1);
  const Eigen::Index k = sizes.num_views * 3 * (c + 1);
  const size_t values_per_row = static_cast<size_t>(info.width) * k;

  // A quarter each for the codes, the covariances and the samples, in turn with the coefficients: half.
  const uint64_t quarter = params.memory_budget_bytes / 4;
  const uint64_t covariance_bytes =
      static_cast<uint64_t>(sizes.num_views * sizes.num_lights * sizes.num_lights) * sizeof(double);
  if (covariance_bytes > quarter) {
    return absl::ResourceExhaustedError(absl::StrCat("covariances of ", sizes.num_lights, " lights in ",
                                                     sizes.num_views, " views take ", covariance_bytes,
                                                     " bytes, a quarter of the memory budget is ", quarter));
  }
  RowPasses passes(source, quarter, /*expected_passes=*/2, context);
  ViewBases bases;
  {
    TESSERA_ASSIGN_OR_RETURN(const std::vector<Eigen::MatrixXd> covariances,
                             Covariances(info, passes, context));
    bases = LeadingEigenvectors(covariances, c, context);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }

  TESSERA_ASSIGN_OR_RETURN(
      const std::unique_ptr<CoefficientStore> store,
      CoefficientStore::Create(values_per_row * info.height, 2 * quarter, params.spill_folder));
  Ranges ranges{std::vector<float>(k, std::numeric_limits<float>::infinity()),
                std::vector<float>(k, -std::numeric_limits<float>::infinity())};
  TESSERA_RETURN_IF_ERROR(passes.Run([&](const SampleBlock& block) -> absl::Status {
    const std::span<float> values =
        store->BeginWrite(values_per_row * block.row, values_per_row * block.num_rows);
    std::atomic<bool> is_legal = true;
    ParallelFor(context, 0, sizes.num_views, 1, [&](int64_t begin, int64_t end) {
      RowOfView row;
      Eigen::MatrixXf scratch;
      for (int64_t view = begin; view < end; ++view) {
        for (int r = 0; r < block.num_rows; ++r) {
          if (!row.Gather(sizes, block.samples.data() + r * source.SamplesPerRow(), view)) {
            is_legal = false;
            return;
          }
          ProjectRow(row, bases.weights[view], view, k, scratch, values.data() + r * values_per_row, ranges);
        }
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (!is_legal) {  // a source that changed its mind
      return IllegalSampleError(info, block.row, block.samples);
    }
    return store->EndWrite();
  }));
  TESSERA_RETURN_IF_ERROR(store->Finish());
  passes.Finish();

  Material material;
  material.width = info.width;
  material.height = info.height;
  material.provenance = info.provenance;
  material.radiometry = info.radiometry;
  material.metadata["captured_light_variance"] = bases.captured_share;
  BtfelTable& table = material.btfels;
  table.codec_id = "view-pca";
  table.codec_version = 1;
  table.num_coefficients = static_cast<int>(k);
  table.parameters = {{"eigen_textures", c}};
  table.views = info.views;
  table.lights = info.lights;
  table.tables = {{"light_weights", WeightTable(bases, sizes.num_lights, c)},
                  {"light_triangles", TriangleTable(info.lights)},
                  {"view_triangles", TriangleTable(info.views)}};
  Quantisation quantisation = UniformQuantisation(ranges.minima, ranges.maxima);
  TESSERA_ASSIGN_OR_RETURN(table.codes, CreateCodes(values_per_row * info.height, params));
  TESSERA_RETURN_IF_ERROR(QuantizeAll(*store, quantisation, table.codes, context));
  table.offset = std::move(quantisation.offset);
  table.step = std::move(quantisation.step);
  return material;
}

}  // namespace tessera
