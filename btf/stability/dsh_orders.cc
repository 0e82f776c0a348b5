#include "btf/stability/dsh_orders.h"

#include <algorithm>
#include <memory>
#include <string>

#include <Eigen/Eigenvalues>

#include "btf/codec/dsh/dsh_basis.h"
#include "btf/codec/dsh/dsh_encoder.h"
#include "btf/codec/dsh/dsh_fitter.h"
#include "btf/math/ridge.h"

namespace tessera {
namespace {

Eigen::MatrixXd BasisTable(const BtfelTable& table, const std::string& name) {
  const CodecTable& values = table.tables.at(name);
  return Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
             values.values.data(), values.shape[0], values.shape[1])
      .cast<double>();
}

double Condition(const Eigen::MatrixXd& basis, const Eigen::MatrixXd& penalty) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(basis.transpose() * basis + penalty,
                                                              Eigen::EigenvaluesOnly);
  const double largest = solver.eigenvalues().tail<1>()[0];
  // What double precision tells from 0.
  constexpr double kSmallestShare = 1e-16;
  return largest / std::max(solver.eigenvalues()[0], kSmallestShare * largest);
}

}  // namespace

absl::StatusOr<UnroundedFit> FitUnrounded(const MemoryBtf& source, const Material& material,
                                          const EncodeParams& params) {
  const BtfInfo& info = source.info();
  const BtfelTable& table = material.btfels;
  const Eigen::MatrixXd light_basis = BasisTable(table, "basis_light");
  const Eigen::MatrixXd view_basis = BasisTable(table, "basis_view");
  const Eigen::MatrixXd lights = DshSamplesOfBasis(info.lights, params.kl) * light_basis.transpose();
  const Eigen::MatrixXd views = DshSamplesOfBasis(info.views, params.kv) * view_basis.transpose();
  const Eigen::MatrixXd light_penalty = DshPenalty(light_basis);
  const Eigen::MatrixXd view_penalty = DshPenalty(view_basis);
  const double light_ridge = table.parameters.value("ridge_light", 0.0);
  const double view_ridge = table.parameters.value("ridge_view", 0.0);

  std::unique_ptr<DshFitter> fitter;
  if (table.codec_id == "dsh-cls") {
    fitter = MakeConstrainedFitter(info, params);
  } else if (table.codec_id == "dsh-ls") {
    fitter = MakeLinearFitter(LeastSquaresFit(lights, kDshLsSingularFloor),
                              LeastSquaresFit(views, kDshLsSingularFloor));
  } else {
    fitter = MakeLinearFitter(RidgeRegression(lights, light_penalty).Fit(light_ridge),
                              RidgeRegression(views, view_penalty).Fit(view_ridge));
  }

  UnroundedFit fit;
  fit.condition =
      std::max(Condition(lights, light_ridge * light_penalty), Condition(views, view_ridge * view_penalty));
  const size_t num_texels = static_cast<size_t>(info.width) * info.height;
  const size_t k = fitter->CoefficientsPerTexel();
  fit.coefficients.resize(num_texels * k);
  DshScratch scratch;
  for (size_t texel = 0; texel < num_texels; ++texel) {
    if (!fitter->Fit(source.samples().data() + texel * fitter->SamplesPerTexel(), 1,
                     fit.coefficients.data() + texel * k, scratch)) {
      return absl::InternalError("the fit refuses samples that the encoder took");
    }
  }
  return fit;
}

}  // namespace tessera
