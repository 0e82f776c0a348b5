#include "btf/codec/dsh/dsh_embedding.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/codec/dsh/dsh_turns.h"
#include "btf/codec/feature_pca.h"
#include "btf/math/hemisphere_gram.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

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

FeatureTurns MakeTurns(int kl, int kv) {
  std::array<std::vector<int>, kQuarterTurns> source;
  std::array<std::vector<double>, kQuarterTurns> sign;
  for (int turns = 0; turns < kQuarterTurns; ++turns) {
    CoefficientTurn turn = MakeDshTurn(kl, kv, turns);
    source[turns] = std::move(turn.source);
    sign[turns].assign(turn.sign.begin(), turn.sign.end());
  }
  return {std::move(source), std::move(sign)};
}

// Coefficients [(channel, j, i)]; weighted, Gl^(1/2) Bl^T C Bv Gv^(1/2) for each channel's C [kl][kv].
class Coefficients final : public TexelFeatures {
 public:
  Coefficients(const BtfelTable& table, const DshDecoder& decoder)
      : table_(table),
        turns_(MakeTurns(decoder.kl(), decoder.kv())),
        light_(Weighting(decoder.basis_light(), decoder.max_light_theta_rad(),
                         [&](const Eigen::Vector3d& d, std::span<double> w) { decoder.LightWeights(d, w); })),
        view_(Weighting(decoder.basis_view(), decoder.max_view_theta_rad(),
                        [&](const Eigen::Vector3d& d, std::span<double> w) { decoder.ViewWeights(d, w); })) {
    view_ /= std::sqrt(3.0);  // the mean over channels
  }

  [[nodiscard]] const FeatureTurns& turns() const override { return turns_; }

  void Compute(int64_t begin, int64_t end, Eigen::MatrixXf& features,
               const RunContext& context) const override {
    const Eigen::Index k = table_.num_coefficients;
    const Eigen::Map<const Eigen::ArrayXf> offset(table_.offset.data(), k);
    const Eigen::Map<const Eigen::ArrayXf> step(table_.step.data(), k);
    constexpr int64_t kTexelsPerTask = 128;
    ParallelFor(context, begin, end, kTexelsPerTask, [&](int64_t first, int64_t last) {
      for (int64_t n = first; n < last; ++n) {
        const Eigen::Map<const Eigen::Array<uint8_t, Eigen::Dynamic, 1>> codes(table_.btfel(n).data(), k);
        features.col(n - begin).array() = offset + codes.cast<float>() * step;
      }
    });
  }

  void Weight(Eigen::Ref<Eigen::VectorXd> v) const override { Map(light_, view_, v); }
  void WeightTransposed(Eigen::Ref<Eigen::VectorXd> v) const override {
    Map(light_.transpose(), view_.transpose(), v);
  }

 private:
  static void Map(const Eigen::MatrixXd& light, const Eigen::MatrixXd& view, Eigen::Ref<Eigen::VectorXd> v) {
    const Eigen::Index size = light.rows() * view.rows();
    for (Eigen::Index channel = 0; channel < 3; ++channel) {
      Eigen::Map<Eigen::MatrixXd> c(v.data() + channel * size, light.rows(), view.rows());
      c = (light * c * view.transpose()).eval();
    }
  }

  const BtfelTable& table_;
  FeatureTurns turns_;
  Eigen::MatrixXd light_;
  Eigen::MatrixXd view_;
};

}  // namespace

absl::StatusOr<Embedding> EmbedDsh(const Material& material, int dims, const RunContext& context) {
  const BtfelTable& table = material.btfels;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DshDecoder> decoder, DshDecoder::Create(table));
  const size_t k = static_cast<size_t>(table.num_coefficients);
  if (material.width < 1 || material.height < 1 ||
      table.codes.size() != static_cast<size_t>(material.width) * material.height * k) {
    return absl::InvalidArgumentError(absl::StrCat(table.codes.size(), " codes, expected ", material.height,
                                                   " x ", material.width, " x ", k));
  }
  return EmbedFeatures(material.width, material.height, Coefficients(table, *decoder), dims, context);
}

}  // namespace tessera
