#include "btf/codec/dsh/dsh_embedding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

constexpr int kTurns = 4;
constexpr Eigen::Index kTile = 256;
constexpr int64_t kTexelsPerChunk = 2048;

// ------------------------------------------------------------------------------------------------ weighting

// Symmetric square root of a symmetric, positive semidefinite matrix.
Eigen::MatrixXd SquareRoot(const Eigen::MatrixXd& gram) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         eigen.eigenvectors().transpose();
}

// G^(1/2) B^T: from coefficients in the table's basis to weighted plain harmonics, one directional argument.
// `weights` are the decoder's, for any direction.
template <typename Weights>
Eigen::MatrixXd Weighting(const Eigen::MatrixXd& basis, double max_theta_rad, const Weights& weights) {
  const int n = static_cast<int>(basis.rows());
  const HemisphereQuadrature quadrature = MakeHemisphereQuadrature(ShDegree(n), max_theta_rad);
  Eigen::MatrixXd decoded(n, quadrature.directions.cols());
  for (Eigen::Index i = 0; i < quadrature.directions.cols(); ++i) {
    weights(quadrature.directions.col(i), std::span(decoded.col(i).data(), static_cast<size_t>(n)));
  }
  const Eigen::MatrixXd plain = basis.partialPivLu().solve(decoded);
  return SquareRoot(GramMatrix(plain.transpose(), quadrature.weights)) * basis.transpose();
}

// The linear map W from coefficients [(channel, j, i)] to weighted ones, and turns of the latter.
class WeightedSpace {
 public:
  explicit WeightedSpace(const DshDecoder& decoder)
      : light_(Weighting(decoder.basis_light(), decoder.max_light_theta_rad(),
                         [&](const Eigen::Vector3d& d, std::span<double> w) { decoder.LightWeights(d, w); })),
        view_(Weighting(decoder.basis_view(), decoder.max_view_theta_rad(),
                        [&](const Eigen::Vector3d& d, std::span<double> w) { decoder.ViewWeights(d, w); })) {
    view_ /= std::sqrt(3.0);  // the mean over channels
    const Eigen::Index kl = light_.rows();
    const Eigen::Index kv = view_.rows();
    for (int turns = 0; turns < kTurns; ++turns) {
      const ShQuarterTurns q = MakeShQuarterTurns(turns);
      for (Eigen::Index channel = 0; channel < 3; ++channel) {
        for (Eigen::Index j = 0; j < kv; ++j) {
          for (Eigen::Index i = 0; i < kl; ++i) {
            source_[turns].push_back(static_cast<int>((channel * kv + q.source[j]) * kl + q.source[i]));
            sign_[turns].push_back(q.sign[j] * q.sign[i]);
          }
        }
      }
    }
  }

  // W v and W^T v, in place.
  void Apply(Eigen::Ref<Eigen::VectorXd> v) const { Map(light_, view_, v); }
  void ApplyTransposed(Eigen::Ref<Eigen::VectorXd> v) const { Map(light_.transpose(), view_.transpose(), v); }

  // R v: (R v)[a] = sign[a] v[source[a]].
  [[nodiscard]] Eigen::VectorXd Turn(int turns, const Eigen::VectorXd& v) const {
    Eigen::VectorXd turned(v.size());
    for (Eigen::Index a = 0; a < v.size(); ++a) {
      turned[a] = sign_[turns][a] * v[source_[turns][a]];
    }
    return turned;
  }
  // R^T v, the turn back.
  [[nodiscard]] Eigen::VectorXd TurnBack(int turns, const Eigen::VectorXd& v) const {
    return Turn((kTurns - turns) % kTurns, v);
  }
  // Mean over turns of R S R^T, column `column`.
  void AverageTurns(const Eigen::MatrixXd& s, Eigen::Index column,
                    Eigen::Ref<Eigen::VectorXd> average) const {
    average.setZero();
    for (int turns = 0; turns < kTurns; ++turns) {
      const double column_sign = sign_[turns][column] / kTurns;
      const double* const from = s.col(source_[turns][column]).data();
      for (Eigen::Index a = 0; a < average.size(); ++a) {
        average[a] += column_sign * sign_[turns][a] * from[source_[turns][a]];
      }
    }
  }

 private:
  static void Map(const Eigen::MatrixXd& light, const Eigen::MatrixXd& view, Eigen::Ref<Eigen::VectorXd> v) {
    const Eigen::Index size = light.rows() * view.rows();
    for (Eigen::Index channel = 0; channel < 3; ++channel) {
      Eigen::Map<Eigen::MatrixXd> c(v.data() + channel * size, light.rows(), view.rows());
      c = (light * c * view.transpose()).eval();
    }
  }

  Eigen::MatrixXd light_;
  Eigen::MatrixXd view_;
  std::array<std::vector<int>, kTurns> source_;
  std::array<std::vector<double>, kTurns> sign_;
};

// ------------------------------------------------------------------------------------------------ covariance

// Centred coefficients of texels [begin, end) as columns, [k][texels].
Eigen::MatrixXf CentredCoefficients(const BtfelTable& table, const Eigen::VectorXd& mean_codes, int64_t begin,
                                    int64_t end, const RunContext& context) {
  const Eigen::Index k = table.num_coefficients;
  Eigen::MatrixXf values(k, end - begin);
  const Eigen::ArrayXf mean = mean_codes.cast<float>();
  const Eigen::Map<const Eigen::ArrayXf> step(table.step.data(), k);
  constexpr int64_t kTexelsPerTask = 128;
  ParallelFor(context, begin, end, kTexelsPerTask, [&](int64_t first, int64_t last) {
    for (int64_t n = first; n < last; ++n) {
      const Eigen::Map<const Eigen::Array<uint8_t, Eigen::Dynamic, 1>> codes(table.btfel(n).data(), k);
      values.col(n - begin).array() = (codes.cast<float>() - mean) * step;
    }
  });
  return values;
}

// Exact: the sums are integers.
Eigen::VectorXd MeanCodes(const BtfelTable& table) {
  std::vector<uint64_t> sums(table.num_coefficients, 0);
  for (size_t n = 0; n < table.size(); ++n) {
    const std::span<const uint8_t> codes = table.btfel(n);
    for (size_t i = 0; i < sums.size(); ++i) {
      sums[i] += codes[i];
    }
  }
  Eigen::VectorXd mean(table.num_coefficients);
  for (Eigen::Index i = 0; i < mean.size(); ++i) {
    mean[i] = static_cast<double>(sums[i]) / static_cast<double>(table.size());
  }
  return mean;
}

// Covariance of the coefficients over the unturned exemplar, in the table's basis. Each tile is summed by one
// task, chunk after chunk, so that threads cannot change a bit.
absl::StatusOr<Eigen::MatrixXd> CoefficientCovariance(const BtfelTable& table,
                                                      const Eigen::VectorXd& mean_codes,
                                                      const RunContext& context) {
  const Eigen::Index k = table.num_coefficients;
  const int64_t num_texels = static_cast<int64_t>(table.size());
  std::vector<std::pair<Eigen::Index, Eigen::Index>> tiles;  // of the lower triangle
  for (Eigen::Index column = 0; column < k; column += kTile) {
    for (Eigen::Index row = column; row < k; row += kTile) {
      tiles.emplace_back(row, column);
    }
  }
  Eigen::MatrixXf sum = Eigen::MatrixXf::Zero(k, k);
  for (int64_t begin = 0; begin < num_texels; begin += kTexelsPerChunk) {
    context.Report("embed", begin, num_texels, "texels");
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const int64_t end = std::min(num_texels, begin + kTexelsPerChunk);
    const Eigen::MatrixXf values = CentredCoefficients(table, mean_codes, begin, end, context);
    ParallelFor(context, 0, static_cast<int64_t>(tiles.size()), 1, [&](int64_t first, int64_t last) {
      for (int64_t t = first; t < last; ++t) {
        const auto [row, column] = tiles[t];
        const Eigen::Index rows = std::min(kTile, k - row);
        const Eigen::Index columns = std::min(kTile, k - column);
        sum.block(row, column, rows, columns).noalias() +=
            values.middleRows(row, rows) * values.middleRows(column, columns).transpose();
      }
    });
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  context.Report("embed", num_texels, num_texels, "texels");
  Eigen::MatrixXd covariance = sum.cast<double>() / static_cast<double>(num_texels);
  covariance.triangularView<Eigen::StrictlyUpper>() = covariance.transpose();
  return covariance;
}

// Covariance of the weighted coefficients over the exemplar in all four turns. `mean` is the weighted mean of
// the unturned one, `centre` its average over turns.
Eigen::MatrixXd TurnedCovariance(const WeightedSpace& space, Eigen::MatrixXd covariance,
                                 const Eigen::VectorXd& mean, const Eigen::VectorXd& centre,
                                 const RunContext& context) {
  const Eigen::Index k = covariance.rows();
  constexpr int64_t kColumnsPerTask = 32;
  for (int side = 0; side < 2; ++side) {
    ParallelFor(context, 0, k, kColumnsPerTask, [&](int64_t first, int64_t last) {
      for (int64_t column = first; column < last; ++column) {
        space.Apply(covariance.col(column));
      }
    });
    covariance.transposeInPlace();
  }
  Eigen::MatrixXd turned(k, k);
  ParallelFor(context, 0, k, kColumnsPerTask, [&](int64_t first, int64_t last) {
    for (int64_t column = first; column < last; ++column) {
      space.AverageTurns(covariance, column, turned.col(column));
    }
  });
  for (int turns = 0; turns < kTurns; ++turns) {
    const Eigen::VectorXd shift = space.Turn(turns, mean) - centre;
    turned.noalias() += (shift / kTurns) * shift.transpose();
  }
  return turned;
}

// ------------------------------------------------------------------------------------------------ components

struct Components {
  Eigen::MatrixXd vectors;  // [k][dims], orthonormal
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
  const Eigen::Index k = s.rows();
  const Eigen::Index block = dims + std::max<Eigen::Index>(dims, 16);
  constexpr Eigen::Index kDirectSize = 192;
  Components components;
  if (k <= kDirectSize || block > k / 2) {
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(s);
    components.vectors = eigen.eigenvectors().rowwise().reverse().leftCols(dims);
    components.variances = eigen.eigenvalues().reverse().head(dims).cwiseMax(0.0);
    return components;
  }
  Rng rng(0x7e55e7a);
  Eigen::MatrixXd v(k, block);
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

absl::StatusOr<Embedding> EmbedDsh(const Material& material, int dims, const RunContext& context) {
  const BtfelTable& table = material.btfels;
  if (dims < 1) {
    return absl::InvalidArgumentError(absl::StrCat("dims = ", dims, ", expected at least 1"));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DshDecoder> decoder, DshDecoder::Create(table));
  const Eigen::Index k = table.num_coefficients;
  if (material.width < 1 || material.height < 1 ||
      table.codes.size() != static_cast<size_t>(material.width) * material.height * static_cast<size_t>(k)) {
    return absl::InvalidArgumentError(absl::StrCat(table.codes.size(), " codes, expected ", material.height,
                                                   " x ", material.width, " x ", k));
  }
  const WeightedSpace space(*decoder);
  const Eigen::VectorXd mean_codes = MeanCodes(table);
  Eigen::VectorXd mean(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    mean[i] = static_cast<double>(table.offset[i]) + static_cast<double>(table.step[i]) * mean_codes[i];
  }
  space.Apply(mean);
  Eigen::VectorXd centre = Eigen::VectorXd::Zero(k);
  for (int turns = 0; turns < kTurns; ++turns) {
    centre += space.Turn(turns, mean) / kTurns;
  }
  TESSERA_ASSIGN_OR_RETURN(Eigen::MatrixXd covariance, CoefficientCovariance(table, mean_codes, context));
  covariance = TurnedCovariance(space, std::move(covariance), mean, centre, context);
  TESSERA_RETURN_IF_ERROR(context.CheckStop());

  Embedding embedding;
  embedding.width = material.width;
  embedding.height = material.height;
  embedding.dims = static_cast<int>(std::min<Eigen::Index>(dims, k));
  embedding.total_variance = covariance.trace();
  TESSERA_ASSIGN_OR_RETURN(Components components, LeadingComponents(covariance, embedding.dims, context));
  FixSigns(components.vectors);
  embedding.variance.assign(components.variances.begin(), components.variances.end());

  // A texel turned is R W c, so its component u is (W^T R^T u) . c: the turns go into the vectors.
  const Eigen::Index d = embedding.dims;
  Eigen::MatrixXf projection(k, kTurns * d);
  Eigen::VectorXf bias(kTurns * d);
  for (int turns = 0; turns < kTurns; ++turns) {
    const Eigen::VectorXd shift = space.Turn(turns, mean) - centre;
    for (Eigen::Index i = 0; i < d; ++i) {
      const Eigen::VectorXd u = components.vectors.col(i);
      Eigen::VectorXd column = space.TurnBack(turns, u);
      space.ApplyTransposed(column);
      projection.col(turns * d + i) = column.cast<float>();
      bias[turns * d + i] = static_cast<float>(u.dot(shift));
    }
  }
  const int64_t num_texels = static_cast<int64_t>(table.size());
  embedding.values.resize(static_cast<size_t>(kTurns) * num_texels * d);
  for (int64_t begin = 0; begin < num_texels; begin += kTexelsPerChunk) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const int64_t end = std::min(num_texels, begin + kTexelsPerChunk);
    const Eigen::MatrixXf values = CentredCoefficients(table, mean_codes, begin, end, context);
    constexpr int64_t kTexelsPerTask = 256;
    ParallelFor(context, begin, end, kTexelsPerTask, [&](int64_t first, int64_t last) {
      Eigen::MatrixXf components_of = projection.transpose() * values.middleCols(first - begin, last - first);
      components_of.colwise() += bias;
      for (int turns = 0; turns < kTurns; ++turns) {
        for (int64_t n = first; n < last; ++n) {
          std::copy_n(components_of.col(n - first).data() + turns * d, d,
                      embedding.values.data() + (turns * num_texels + n) * d);
        }
      }
    });
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  return embedding;
}

}  // namespace tessera
