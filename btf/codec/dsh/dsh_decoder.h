// Decoding of double spherical harmonics: reflectance = sum over i, j of yl_i(light) yv_j(view) c_ij, one sum
// a channel, with k index (channel * kv + j) * kl + i.
//
// yl and yv are real spherical harmonics (math/spherical_harmonics.h) mapped by the tables `basis_light`
// [kl][kl] and `basis_view` [kv][kv] (y'_i = sum_m basis[i][m] y_m; the identity for dsh-cls), extended over
// the hemisphere as codec/FORMAT.md says: clamped beyond the largest measured polar angle, light weights then
// scaled by cos(theta) / cos(theta_max), zero at and below the horizon. Source: [Leung2007] 3.1 and 4.2.
//
// Callers that decode many texels under few directions take the weights once:
//
//   decoder->LightWeights(light, yl);  decoder->ViewWeights(view, yv);   // then their own products
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/codec/decoder.h"

namespace tessera {

class DshDecoder final : public Decoder {
 public:
  // Errors: INVALID_ARGUMENT naming the table, parameter or direction set that is missing or misshapen, or
  // the number of coefficients when it is not 3 kl kv.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<DshDecoder>> Create(const BtfelTable& table);

  [[nodiscard]] int kl() const { return static_cast<int>(basis_light_.rows()); }
  [[nodiscard]] int kv() const { return static_cast<int>(basis_view_.rows()); }
  // Largest measured polar angles, in [0, pi/2].
  [[nodiscard]] double max_light_theta_rad() const { return light_limit_.theta_rad; }
  [[nodiscard]] double max_view_theta_rad() const { return view_limit_.theta_rad; }
  // Square, row i holds the plain harmonics' weights in basis function i.
  [[nodiscard]] const Eigen::MatrixXd& basis_light() const { return basis_light_; }
  [[nodiscard]] const Eigen::MatrixXd& basis_view() const { return basis_view_; }

  // weights[i] = yl_i(light), [kl], or yv_j(view), [kv], with clamp, scale and horizon. Directions are unit,
  // in the unturned frame.
  void LightWeights(const Eigen::Vector3d& light, std::span<double> weights) const;
  void ViewWeights(const Eigen::Vector3d& view, std::span<double> weights) const;

  // A of [Leung2007] eq. 2, [kl][kMaxShFunctions]: the integrals of LightWeights with each harmonic. Times
  // the harmonics of an environment in the BTFel's own frame, they stand where LightWeights of one light
  // stand, and pi times the radiance comes out. The first call integrates.
  [[nodiscard]] const Eigen::MatrixXd& LightIntegrals() const;

  [[nodiscard]] LinearForm Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const override;
  [[nodiscard]] std::vector<LinearForm> LightHarmonics(int n, const Eigen::Vector3d& view) const override;

 private:
  struct PolarLimit {
    double theta_rad = 0.0;
    double cos_theta = 1.0;
    double sin_theta = 0.0;
  };

  DshDecoder(const BtfelTable& table, Eigen::MatrixXd basis_light, Eigen::MatrixXd basis_view);
  static PolarLimit LimitOf(const std::vector<Direction>& directions);
  // Harmonics of the clamped direction in `basis`; false, and zeros, at or below the horizon.
  static bool Weights(const Eigen::Vector3d& direction, const PolarLimit& limit, const Eigen::MatrixXd& basis,
                      bool is_plain, std::span<double> weights);
  // Weights of coefficients: products of light weights [kl] and view weights [kv].
  [[nodiscard]] LinearForm FormOf(std::span<const double> light_weights,
                                  std::span<const double> view_weights) const;

  Eigen::MatrixXd basis_light_;
  Eigen::MatrixXd basis_view_;
  bool is_light_plain_ = false;
  bool is_view_plain_ = false;
  PolarLimit light_limit_;
  PolarLimit view_limit_;
  mutable std::once_flag is_integrated_;
  mutable Eigen::MatrixXd light_integrals_;
};

}  // namespace tessera
