#include "btf/codec/dsh/dsh_fitter.h"

#include <algorithm>
#include <cmath>

#include "btf/codec/encoder_input.h"
#include "btf/math/constrained_least_squares.h"
#include "btf/math/spherical_harmonics.h"

namespace tessera {
namespace {

using Solver = ClsSolver<float>;
using MatrixMap = Eigen::Map<const Eigen::MatrixXf>;

// Signals fitted together, about: few enough for the products' operands to stay in the second-level cache
// (and Eigen's copies of them on the stack), enough to fill vectors where there are few views. Sums are
// formed within a signal only.
constexpr int64_t kSignalsPerGroup = 256;

Eigen::Index PadToLanes(Eigen::Index rows) {
  return (rows + Solver::kLanes - 1) / Solver::kLanes * Solver::kLanes;
}

// sum f^2 in a fixed order whatever the address, which decides how a library would cut the sum.
float SumOfSquares(const float* f, Eigen::Index count) {
  using Lanes = Eigen::Array<float, 8, 1>;
  constexpr Eigen::Index kWidth = Lanes::SizeAtCompileTime;
  Lanes even = Lanes::Zero();  // two sums, so that one addition need not wait for the other
  Lanes odd = Lanes::Zero();
  Eigen::Index i = 0;
  for (; i + 2 * kWidth <= count; i += 2 * kWidth) {
    even += Eigen::Map<const Lanes>(f + i).square();
    odd += Eigen::Map<const Lanes>(f + i + kWidth).square();
  }
  float rest = 0.0F;
  for (; i < count; ++i) {
    rest += f[i] * f[i];
  }
  even += odd;
  return rest + even.sum();
}

// `sum_of_squares` is theirs: one look at it clears almost every signal; NaN fails every comparison.
bool AreLegalSamples(const float* f, Eigen::Index count, float sum_of_squares) {
  return sum_of_squares <= kLargestSample * kLargestSample || std::all_of(f, f + count, IsLegalSample);
}

double SolidAngle(ClsEnergy energy) {
  return energy == ClsEnergy::kHemisphere ? 2.0 * kPi : 4.0 * kPi;
}

class ConstrainedFitter final : public DshFitter {
 public:
  ConstrainedFitter(const BtfInfo& info, const EncodeParams& params)
      : DshFitter(static_cast<Eigen::Index>(info.lights.size()), static_cast<Eigen::Index>(info.views.size()),
                  params.kl, params.kv),
        light_energy_scale_(
            static_cast<float>(SolidAngle(params.cls_energy) / static_cast<double>(num_lights_))),
        view_energy_scale_(
            static_cast<float>(SolidAngle(params.cls_energy) / static_cast<double>(num_views_))),
        light_solver_(DshSamplesOfBasis(info.lights, params.kl)),
        view_solver_(DshSamplesOfBasis(info.views, params.kv)) {}

  [[nodiscard]] bool Fit(const float* samples, int num_texels, float* coefficients,
                         DshScratch& scratch) const override {
    const Eigen::Index num_blocks = Eigen::Index{3} * num_texels;  // (texel, channel)
    if (!FitLights(samples, num_blocks * num_views_, scratch)) {
      return false;
    }
    // Back to harmonics, and at once with the views running fastest, as the second pass wants them.
    scratch.view_samples.resize(num_views_, num_blocks * kl_);
    for (Eigen::Index block = 0; block < num_blocks; ++block) {
      scratch.view_samples.middleCols(block * kl_, kl_).noalias() =
          scratch.projected.middleRows(block * num_views_, num_views_) *
          light_solver_.eigenvectors().transpose();
    }
    FitViews(num_blocks * kl_, scratch);
    for (Eigen::Index block = 0; block < num_blocks; ++block) {
      for (Eigen::Index j = 0; j < kv_; ++j) {
        std::copy_n(scratch.coefficients.col(j).data() + block * kl_, kl_, coefficients);
        coefficients += kl_;
      }
    }
    return true;
  }

 private:
  bool FitLights(const float* samples, Eigen::Index num_signals, DshScratch& scratch) const {
    const Eigen::Index padded = PadToLanes(num_signals);
    scratch.energies.resize(padded);
    for (Eigen::Index s = 0; s < num_signals; ++s) {
      const float* const f = samples + s * num_lights_;
      const float sum = SumOfSquares(f, num_lights_);
      if (!AreLegalSamples(f, num_lights_, sum)) {
        return false;
      }
      scratch.energies[s] = light_energy_scale_ * sum;
    }
    scratch.energies.tail(padded - num_signals).setZero();
    scratch.projected.resize(padded, kl_);
    scratch.projected.topRows(num_signals).noalias() =
        MatrixMap(samples, num_lights_, num_signals).transpose() * light_solver_.projection().transpose();
    scratch.projected.bottomRows(padded - num_signals).setZero();
    light_solver_.Shrink(scratch.energies, scratch.projected);
    return true;
  }

  void FitViews(Eigen::Index num_signals, DshScratch& scratch) const {
    const Eigen::Index padded = PadToLanes(num_signals);
    scratch.energies.resize(padded);
    for (Eigen::Index s = 0; s < num_signals; ++s) {
      scratch.energies[s] = view_energy_scale_ * SumOfSquares(scratch.view_samples.col(s).data(), num_views_);
    }
    scratch.energies.tail(padded - num_signals).setZero();
    scratch.projected.resize(padded, kv_);
    scratch.projected.topRows(num_signals).noalias() =
        scratch.view_samples.transpose() * view_solver_.projection().transpose();
    scratch.projected.bottomRows(padded - num_signals).setZero();
    view_solver_.Shrink(scratch.energies, scratch.projected);
    scratch.coefficients.resize(num_signals, kv_);
    scratch.coefficients.noalias() =
        scratch.projected.topRows(num_signals) * view_solver_.eigenvectors().transpose();
  }

  float light_energy_scale_;
  float view_energy_scale_;
  Solver light_solver_;
  Solver view_solver_;
};

class LinearFitter final : public DshFitter {
 public:
  LinearFitter(const Eigen::MatrixXd& light_fit, const Eigen::MatrixXd& view_fit)
      : DshFitter(light_fit.cols(), view_fit.cols(), light_fit.rows(), view_fit.rows()),
        light_fit_(light_fit.cast<float>()),
        view_fit_transposed_(view_fit.transpose().cast<float>()) {}

  [[nodiscard]] bool Fit(const float* samples, int num_texels, float* coefficients,
                         DshScratch& scratch) const override {
    const Eigen::Index num_blocks = Eigen::Index{3} * num_texels;  // (texel, channel)
    const Eigen::Index num_signals = num_blocks * num_views_;
    for (Eigen::Index s = 0; s < num_signals; ++s) {
      const float* const f = samples + s * num_lights_;
      if (!AreLegalSamples(f, num_lights_, SumOfSquares(f, num_lights_))) {
        return false;
      }
    }
    scratch.light_coefficients.resize(kl_, num_signals);
    scratch.light_coefficients.noalias() = light_fit_ * MatrixMap(samples, num_lights_, num_signals);
    // [kl][views] times [views][kv]: at once in the order of the result.
    for (Eigen::Index block = 0; block < num_blocks; ++block) {
      Eigen::Map<Eigen::MatrixXf>(coefficients + block * kl_ * kv_, kl_, kv_).noalias() =
          scratch.light_coefficients.middleCols(block * num_views_, num_views_) * view_fit_transposed_;
    }
    return true;
  }

 private:
  Eigen::MatrixXf light_fit_;            // [kl][lights]
  Eigen::MatrixXf view_fit_transposed_;  // [views][kv]
};

}  // namespace

int64_t DshFitter::TexelsPerGroup() const {
  return std::max<int64_t>(1, kSignalsPerGroup / (3 * std::max<int64_t>(num_views_, kl_)));
}

Eigen::MatrixXd DshSamplesOfBasis(const std::vector<Direction>& directions, int n) {
  Eigen::Matrix3Xd vectors(3, directions.size());
  for (size_t i = 0; i < directions.size(); ++i) {
    vectors.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(directions[i]);
  }
  return ShMatrix(n, vectors);
}

std::unique_ptr<DshFitter> MakeConstrainedFitter(const BtfInfo& info, const EncodeParams& params) {
  return std::make_unique<ConstrainedFitter>(info, params);
}

std::unique_ptr<DshFitter> MakeLinearFitter(const Eigen::MatrixXd& light_fit,
                                            const Eigen::MatrixXd& view_fit) {
  return std::make_unique<LinearFitter>(light_fit, view_fit);
}

}  // namespace tessera
