#include "btf/codec/dfmf/dfmf_embedding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Eigenvalues>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/math/hemisphere_gram.h"

namespace tessera {
namespace {

constexpr int kTurns = 4;
constexpr int64_t kTexelsPerChunk = 2048;
// Fits factors that are linear between the grid's nodes, about 12 degrees apart.
constexpr int kQuadratureDegree = 3;

// Colour weights of every coefficient under one light and all views, seen after `turns`: [3 views][k].
Eigen::MatrixXd WeightsUnder(const DfmfDecoder& decoder, const Eigen::Vector3d& light,
                             const Eigen::Matrix3Xd& views, int turns) {
  const Eigen::Index r = decoder.luma_rank();
  const Eigen::Index q = decoder.chroma_rank();
  Eigen::MatrixXd weights(3 * views.cols(), r + q);
  Eigen::VectorXd factors(decoder.num_factors());
  for (Eigen::Index v = 0; v < views.cols(); ++v) {
    decoder.Factors(UnturnedFromTurned(light, turns), UnturnedFromTurned(views.col(v), turns),
                    std::span(factors.data(), static_cast<size_t>(factors.size())));
    for (int channel = 0; channel < 3; ++channel) {
      auto row = weights.row(3 * v + channel);
      row.head(r) = decoder.colour()(channel, 0) * factors.head(r).transpose();
      row.tail(q) = decoder.colour()(channel, 1) * factors.segment(r, q).transpose() +
                    decoder.colour()(channel, 2) * factors.tail(q).transpose();
    }
  }
  return weights;
}

// Gram matrix of the functions in all turns, [4 k][4 k], mean over channels. Turning both functions changes
// no integral, so it is made of four blocks: unturned against each turn.
Eigen::MatrixXd TurnedGram(const DfmfDecoder& decoder, const RunContext& context) {
  const HemisphereQuadrature lights =
      MakeHemisphereQuadrature(kQuadratureDegree, decoder.max_light_theta_rad());
  const HemisphereQuadrature views =
      MakeHemisphereQuadrature(kQuadratureDegree, decoder.max_view_theta_rad());
  const Eigen::Index k = decoder.num_coefficients();
  const Eigen::VectorXd view_weights = views.weights.replicate(1, 3).transpose().reshaped() / 3.0;
  std::array<Eigen::MatrixXd, kTurns> blocks;
  ParallelFor(context, 0, kTurns, 1, [&](int64_t begin, int64_t end) {
    for (int64_t turn = begin; turn < end; ++turn) {
      blocks[turn] = Eigen::MatrixXd::Zero(k, k);
      for (Eigen::Index l = 0; l < lights.weights.size() && !context.stop.stop_requested(); ++l) {
        const Eigen::MatrixXd still = WeightsUnder(decoder, lights.directions.col(l), views.directions, 0);
        const Eigen::MatrixXd turned =
            WeightsUnder(decoder, lights.directions.col(l), views.directions, static_cast<int>(turn));
        blocks[turn].noalias() +=
            (lights.weights[l] * still.transpose()) * (view_weights.asDiagonal() * turned);
      }
    }
  });
  Eigen::MatrixXd gram(kTurns * k, kTurns * k);
  for (int a = 0; a < kTurns; ++a) {
    for (int b = 0; b < kTurns; ++b) {
      const Eigen::MatrixXd& block = blocks[(b - a + kTurns) % kTurns];
      gram.block(a * k, b * k, k, k) = block.rows() == k ? block : Eigen::MatrixXd::Zero(k, k);
    }
  }
  return 0.5 * (gram + gram.transpose());
}

// Centred coefficients of texels [begin, end) as columns.
Eigen::MatrixXd Centred(const BtfelTable& table, const Eigen::VectorXd& mean_codes, int64_t begin,
                        int64_t end) {
  Eigen::MatrixXd values(mean_codes.size(), end - begin);
  for (int64_t n = begin; n < end; ++n) {
    const std::span<const uint8_t> codes = table.btfel(n);
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      values(i, n - begin) = static_cast<double>(table.step[i]) * (codes[i] - mean_codes[i]);
    }
  }
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

}  // namespace

absl::StatusOr<Embedding> EmbedDfmf(const Material& material, int dims, const RunContext& context) {
  const BtfelTable& table = material.btfels;
  if (dims < 1) {
    return absl::InvalidArgumentError(absl::StrCat("dims = ", dims, ", expected at least 1"));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DfmfDecoder> decoder, DfmfDecoder::Create(table));
  const Eigen::Index k = table.num_coefficients;
  if (material.width < 1 || material.height < 1 ||
      table.codes.size() != static_cast<size_t>(material.width) * material.height * static_cast<size_t>(k)) {
    return absl::InvalidArgumentError(absl::StrCat(table.codes.size(), " codes, expected ", material.height,
                                                   " x ", material.width, " x ", k));
  }
  const int64_t num_texels = static_cast<int64_t>(table.size());
  context.Report("embed", 0, num_texels, "texels");
  const Eigen::MatrixXd gram = TurnedGram(*decoder, context);
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  // Coordinates of the coefficients c of turn t: columns [t k, (t + 1) k) of the square root, times c.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> metric(gram);
  const Eigen::MatrixXd root = metric.eigenvectors() *
                               metric.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
                               metric.eigenvectors().transpose();
  const Eigen::VectorXd mean_codes = MeanCodes(table);
  Eigen::VectorXd mean(k);
  for (Eigen::Index i = 0; i < k; ++i) {
    mean[i] = static_cast<double>(table.offset[i]) + static_cast<double>(table.step[i]) * mean_codes[i];
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(k, k);
  for (int64_t begin = 0; begin < num_texels; begin += kTexelsPerChunk) {
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    const Eigen::MatrixXd values =
        Centred(table, mean_codes, begin, std::min(num_texels, begin + kTexelsPerChunk));
    covariance.noalias() += values * values.transpose() / static_cast<double>(num_texels);
  }
  Eigen::MatrixXd shifts(kTurns * k, kTurns);
  for (int turn = 0; turn < kTurns; ++turn) {
    shifts.col(turn) = root.middleCols(turn * k, k) * mean;
  }
  const Eigen::VectorXd centre = shifts.rowwise().mean();
  shifts.colwise() -= centre;
  Eigen::MatrixXd turned = shifts * shifts.transpose() / kTurns;
  for (int turn = 0; turn < kTurns; ++turn) {
    const auto block = root.middleCols(turn * k, k);
    turned.noalias() += block * covariance * block.transpose() / kTurns;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(0.5 * (turned + turned.transpose()));
  TESSERA_RETURN_IF_ERROR(context.CheckStop());

  Embedding embedding;
  embedding.width = material.width;
  embedding.height = material.height;
  embedding.dims = static_cast<int>(std::min<Eigen::Index>(dims, kTurns * k));
  embedding.total_variance = eigen.eigenvalues().cwiseMax(0.0).sum();
  const Eigen::Index d = embedding.dims;
  Eigen::MatrixXd axes = eigen.eigenvectors().rowwise().reverse().leftCols(d);
  for (Eigen::Index i = 0; i < d; ++i) {
    Eigen::Index largest = 0;
    axes.col(i).cwiseAbs().maxCoeff(&largest);
    axes.col(i) *= axes(largest, i) < 0.0 ? -1.0 : 1.0;
    embedding.variance.push_back(std::max(0.0, eigen.eigenvalues()[kTurns * k - 1 - i]));
  }
  embedding.values.resize(static_cast<size_t>(kTurns) * num_texels * d);
  for (int turn = 0; turn < kTurns; ++turn) {
    const Eigen::MatrixXd projection = axes.transpose() * root.middleCols(turn * k, k);
    const Eigen::VectorXd bias = axes.transpose() * shifts.col(turn);
    ParallelFor(context, 0, num_texels, kTexelsPerChunk, [&](int64_t begin, int64_t end) {
      Eigen::MatrixXd values = projection * Centred(table, mean_codes, begin, end);
      values.colwise() += bias;
      Eigen::Map<Eigen::MatrixXf>(embedding.values.data() + (turn * num_texels + begin) * d, d, end - begin) =
          values.cast<float>();
    });
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  context.Report("embed", num_texels, num_texels, "texels");
  return embedding;
}

}  // namespace tessera
