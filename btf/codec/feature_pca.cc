#include "btf/codec/feature_pca.h"

#include <algorithm>
#include <utility>

#include <absl/strings/str_cat.h>
#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr Eigen::Index kTile = 256;
constexpr int64_t kTexelsPerChunk = 2048;
constexpr int64_t kMostKeptBytes = int64_t{512} << 20;  // of features, lest they be computed twice

// ------------------------------------------------------------------------------------------------ covariance

// Of unweighted features over the unturned exemplar.
struct Moments {
  Eigen::VectorXf shift;  // near the mean: what features are taken relative to, so that float sums suffice
  Eigen::VectorXd mean;
  Eigen::MatrixXd covariance;
  std::vector<Eigen::MatrixXf> kept;  // features less shift, by chunk; none where they take too much
};

// Each tile is summed by one task, chunk after chunk, so that threads cannot change a bit.
absl::StatusOr<Moments> ComputeMoments(const TexelFeatures& features, int64_t num_texels,
                                       const RunContext& context) {
  const Eigen::Index size = features.turns().size();
  std::vector<std::pair<Eigen::Index, Eigen::Index>> tiles;  // of the lower triangle
  for (Eigen::Index column = 0; column < size; column += kTile) {
    for (Eigen::Index row = column; row < size; row += kTile) {
      tiles.emplace_back(row, column);
    }
  }
  Moments moments;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(size);
  Eigen::MatrixXf products = Eigen::MatrixXf::Zero(size, size);
  const bool is_kept = num_texels * size * static_cast<int64_t>(sizeof(float)) <= kMostKeptBytes;
  Eigen::MatrixXf values;
  for (int64_t begin = 0; begin < num_texels; begin += kTexelsPerChunk) {
    context.Report("embed", begin, num_texels, "texels");
    const int64_t end = std::min(num_texels, begin + kTexelsPerChunk);
    values.resize(size, end - begin);
    features.Compute(begin, end, values, context);
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (begin == 0) {
      moments.shift = values.cast<double>().rowwise().mean().cast<float>();
    }
    values.colwise() -= moments.shift;
    sum += values.cast<double>().rowwise().sum();
    ParallelFor(context, 0, static_cast<int64_t>(tiles.size()), 1, [&](int64_t first, int64_t last) {
      for (int64_t t = first; t < last; ++t) {
        const auto [row, column] = tiles[t];
        const Eigen::Index rows = std::min(kTile, size - row);
        const Eigen::Index columns = std::min(kTile, size - column);
        products.block(row, column, rows, columns).noalias() +=
            values.middleRows(row, rows) * values.middleRows(column, columns).transpose();
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    if (is_kept) {
      moments.kept.push_back(std::move(values));
    }
  }
  context.Report("embed", num_texels, num_texels, "texels");
  const Eigen::VectorXd offset = sum / static_cast<double>(num_texels);
  moments.mean = moments.shift.cast<double>() + offset;
  moments.covariance = products.cast<double>() / static_cast<double>(num_texels);
  moments.covariance.triangularView<Eigen::StrictlyUpper>() = moments.covariance.transpose();
  moments.covariance.noalias() -= offset * offset.transpose();
  return moments;
}

// Covariance of weighted features over the exemplar in all four turns. `mean` is the weighted mean of the
// unturned one, `centre` its average over turns.
Eigen::MatrixXd TurnedCovariance(const TexelFeatures& features, Eigen::MatrixXd covariance,
                                 const Eigen::VectorXd& mean, const Eigen::VectorXd& centre,
                                 const RunContext& context) {
  const FeatureTurns& turns = features.turns();
  const Eigen::Index size = turns.size();
  constexpr int64_t kColumnsPerTask = 32;
  for (int side = 0; side < 2; ++side) {
    ParallelFor(context, 0, size, kColumnsPerTask, [&](int64_t first, int64_t last) {
      for (int64_t column = first; column < last; ++column) {
        features.Weight(covariance.col(column));
      }
    });
    covariance.transposeInPlace();
  }
  Eigen::MatrixXd turned(size, size);
  ParallelFor(context, 0, size, kColumnsPerTask, [&](int64_t first, int64_t last) {
    for (int64_t column = first; column < last; ++column) {
      turns.AverageTurns(covariance, column, turned.col(column));
    }
  });
  for (int t = 0; t < kQuarterTurns; ++t) {
    const Eigen::VectorXd shift = turns.Turn(t, mean) - centre;
    turned.noalias() += (shift / kQuarterTurns) * shift.transpose();
  }
  return turned;
}

// ------------------------------------------------------------------------------------------------ components

struct Components {
  Eigen::MatrixXd vectors;  // [F][dims], orthonormal
  Eigen::VectorXd variances;
};

Eigen::MatrixXd Multiply(const Eigen::MatrixXd& s, const Eigen::MatrixXd& v, const RunContext& context) {
  Eigen::MatrixXd product(s.rows(), v.cols());
  constexpr int64_t kRowsPerTask = 128;
  ParallelFor(context, 0, s.rows(), kRowsPerTask, [&](int64_t first, int64_t last) {
    // s is symmetric: its columns are its rows, and lie together.
    product.middleRows(first, last - first).noalias() = s.middleCols(first, last - first).transpose() * v;
  });
  return product;
}

Eigen::MatrixXd Orthonormal(const Eigen::MatrixXd& v) {
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(v);
  return qr.householderQ() * Eigen::MatrixXd::Identity(v.rows(), v.cols());
}

// The `dims` leading eigenvectors of the symmetric, positive semidefinite s. Small or complete problems are
// solved directly, others by subspace iteration with Rayleigh-Ritz (Halko2011 4.5 with repeated powers).
absl::StatusOr<Components> LeadingComponents(const Eigen::MatrixXd& s, Eigen::Index dims,
                                             const RunContext& context) {
  const Eigen::Index size = s.rows();
  const Eigen::Index block = dims + std::max<Eigen::Index>(dims, 16);
  constexpr Eigen::Index kDirectSize = 192;
  Components components;
  if (size <= kDirectSize || block > size / 2) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(s);
    components.vectors = eigen.eigenvectors().rowwise().reverse().leftCols(dims);
    components.variances = eigen.eigenvalues().reverse().head(dims).cwiseMax(0.0);
    return components;
  }
  Rng rng(0x7e55e7a);
  Eigen::MatrixXd v(size, block);
  for (Eigen::Index i = 0; i < v.size(); ++i) {
    v.data()[i] = rng.NextDouble() - 0.5;
  }
  v = Orthonormal(v);
  Eigen::VectorXd previous = Eigen::VectorXd::Zero(dims);
  constexpr int kMaxIterations = 100;
  constexpr double kTolerance =
      1e-7;  // relative change of a variance; the vectors' errors are its square root
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const Eigen::MatrixXd product = Multiply(s, v, context);
    const Eigen::MatrixXd small = v.transpose() * product;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (small + small.transpose()));
    const Eigen::MatrixXd rotation = eigen.eigenvectors().rowwise().reverse();
    components.variances = eigen.eigenvalues().reverse().head(dims).cwiseMax(0.0);
    components.vectors = v * rotation.leftCols(dims);
    const double change = (components.variances - previous).cwiseAbs().maxCoeff();
    if (change <= kTolerance * components.variances[dims - 1]) {
      break;
    }
    previous = components.variances;
    v = Orthonormal(product * rotation);
  }
  return components;
}

void FixSigns(Eigen::MatrixXd& vectors) {
  for (Eigen::Index i = 0; i < vectors.cols(); ++i) {
    Eigen::Index largest = 0;
    vectors.col(i).cwiseAbs().maxCoeff(&largest);
    if (vectors(largest, i) < 0.0) {
      vectors.col(i) *= -1.0;
    }
  }
}

}  // namespace

FeatureTurns::FeatureTurns(std::array<std::vector<int>, kQuarterTurns> source,
                           std::array<std::vector<double>, kQuarterTurns> sign)
    : source_(std::move(source)), sign_(std::move(sign)) {}

Eigen::VectorXd FeatureTurns::Turn(int turns, const Eigen::VectorXd& f) const {
  Eigen::VectorXd turned(f.size());
  for (Eigen::Index a = 0; a < f.size(); ++a) {
    turned[a] = sign_[turns][a] * f[source_[turns][a]];
  }
  return turned;
}

Eigen::VectorXd FeatureTurns::TurnBack(int turns, const Eigen::VectorXd& f) const {
  return Turn((kQuarterTurns - turns) % kQuarterTurns, f);
}

void FeatureTurns::AverageTurns(const Eigen::MatrixXd& s, Eigen::Index column,
                                Eigen::Ref<Eigen::VectorXd> average) const {
  average.setZero();
  for (int turns = 0; turns < kQuarterTurns; ++turns) {
    const double column_sign = sign_[turns][column] / kQuarterTurns;
    const double* const from = s.col(source_[turns][column]).data();
    for (Eigen::Index a = 0; a < average.size(); ++a) {
      average[a] += column_sign * sign_[turns][a] * from[source_[turns][a]];
    }
  }
}

void TexelFeatures::Weight(Eigen::Ref<Eigen::VectorXd> /*v*/) const {}
void TexelFeatures::WeightTransposed(Eigen::Ref<Eigen::VectorXd> /*v*/) const {}

absl::StatusOr<Embedding> EmbedFeatures(int width, int height, const TexelFeatures& features, int dims,
                                        const RunContext& context) {
  if (dims < 1) {
    return absl::InvalidArgumentError(absl::StrCat("dims = ", dims, ", expected at least 1"));
  }
  const FeatureTurns& turns = features.turns();
  const Eigen::Index size = turns.size();
  const int64_t num_texels = static_cast<int64_t>(width) * height;
  TESSERA_ASSIGN_OR_RETURN(Moments moments, ComputeMoments(features, num_texels, context));
  Eigen::VectorXd mean = moments.mean;
  features.Weight(mean);
  Eigen::VectorXd weighted_shift = moments.shift.cast<double>();
  features.Weight(weighted_shift);
  Eigen::VectorXd centre = Eigen::VectorXd::Zero(size);
  for (int t = 0; t < kQuarterTurns; ++t) {
    centre += turns.Turn(t, mean) / kQuarterTurns;
  }
  const Eigen::MatrixXd covariance =
      TurnedCovariance(features, std::move(moments.covariance), mean, centre, context);
  TESSERA_RETURN_IF_ERROR(context.CheckStop());

  Embedding embedding;
  embedding.width = width;
  embedding.height = height;
  embedding.dims = static_cast<int>(std::min<Eigen::Index>(dims, size));
  embedding.total_variance = covariance.trace();
  TESSERA_ASSIGN_OR_RETURN(Components components, LeadingComponents(covariance, embedding.dims, context));
  FixSigns(components.vectors);
  embedding.variance.assign(components.variances.begin(), components.variances.end());

  // A turned texel is R W f, so its component u is (W^T R^T u) . (f - shift) + u . (R W shift - centre): the
  // turns go into the vectors.
  const Eigen::Index d = embedding.dims;
  Eigen::MatrixXf projection(size, kQuarterTurns * d);
  Eigen::VectorXf bias(kQuarterTurns * d);
  for (int t = 0; t < kQuarterTurns; ++t) {
    const Eigen::VectorXd shift = turns.Turn(t, weighted_shift) - centre;
    for (Eigen::Index i = 0; i < d; ++i) {
      const Eigen::VectorXd u = components.vectors.col(i);
      Eigen::VectorXd column = turns.TurnBack(t, u);
      features.WeightTransposed(column);
      projection.col(t * d + i) = column.cast<float>();
      bias[t * d + i] = static_cast<float>(u.dot(shift));
    }
  }
  embedding.values.resize(static_cast<size_t>(kQuarterTurns) * num_texels * d);
  Eigen::MatrixXf values;
  for (int64_t begin = 0; begin < num_texels; begin += kTexelsPerChunk) {
    const int64_t end = std::min(num_texels, begin + kTexelsPerChunk);
    if (moments.kept.empty()) {
      values.resize(size, end - begin);
      features.Compute(begin, end, values, context);
      TESSERA_RETURN_IF_ERROR(context.CheckStop());
      values.colwise() -= moments.shift;
    } else {
      values = std::move(moments.kept[begin / kTexelsPerChunk]);
    }
    constexpr int64_t kTexelsPerTask = 256;
    ParallelFor(context, begin, end, kTexelsPerTask, [&](int64_t first, int64_t last) {
      Eigen::MatrixXf components_of = projection.transpose() * values.middleCols(first - begin, last - first);
      components_of.colwise() += bias;
      for (int t = 0; t < kQuarterTurns; ++t) {
        for (int64_t n = first; n < last; ++n) {
          std::copy_n(components_of.col(n - first).data() + t * d, d,
                      embedding.values.data() + (t * num_texels + n) * d);
        }
      }
    });
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  return embedding;
}

}  // namespace tessera
