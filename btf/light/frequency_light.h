// Environment light in the frequency domain: [Leung2007] 4.2, eq. 1 and 2.
//
//   radiance p = c_rho(v)^T A R c_e                                                          (eq. 1)
//
// c_e, the environment in spherical harmonics, [n][3], is ProjectEnvironment; R, its rotation into a tile's
// frame, ShRotation (FrequencyLight::InFrame); A, the integrals over the hemisphere of products of two
// harmonics (eq. 2), the decoder's light side (Decoder::LightHarmonics); c_rho(v) the coefficients under one
// view. Differs from eq. 1 in A: decoding clamps light beyond the largest measured polar angle, "dsh" has a
// basis of its own, and dfmf and view-pca none at all; A is here the integral of Y_i with the codec's own
// functions of light, as they decode. It is A of eq. 2 for "dsh-cls" measured down to the horizon. Values
// contain the cosine (pi f_r cos theta_i), so nothing else is in the integral, and radiance is its 1 / pi
// (render/preview.h's rule for irradiance).
//
//   TESSERA_ASSIGN_OR_RETURN(const FrequencyLight light, FrequencyLight::Create(environment, /*n=*/25));
//   // once a frame, [25][3]
//   const Eigen::MatrixXd in_frame = light.InFrame(local_from_world);
//   // once a view and turn
//   const LinearForm form = RadianceForm(*decoder, view, in_frame, /*turns=*/0);
//   // once a BTFel
//   const Eigen::Array3d radiance = form.ValueOf(coefficients).max(0.0);
//
// Exact for the light that n harmonics hold; what they do not hold is lost. Values are summed before the
// clamp at 0 that ends every decode, so dark BTFels may come out below. No light is shadowed by the mesh.
#pragma once

#include <span>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/decoder.h"
#include "btf/light/environment.h"

namespace tessera {

// Taking high degrees back lessens the rings around a small bright light, and blurs the rest: degree l of
// 0..L times sin(x) / x, x = pi l / (L + 1) (Lanczos).
enum class ShWindow { kNone, kLanczos };

// The environment's coefficients, [n][3], in harmonics of the world's directions: the integral of radiance
// times Y_i, radiance constant over each texel. Exact but for rounding for kEquirect (closed in azimuth,
// Gauss-Legendre in elevation), 1e-5 of degree 6 for kAngular. Errors: INVALID_ARGUMENT (n is not 1, 4, 9,
// 16, 25, 36 or 49).
[[nodiscard]] absl::StatusOr<Eigen::MatrixXd> ProjectEnvironment(const Environment& environment, int n,
                                                                 ShWindow window = ShWindow::kNone);

// Immutable.
class FrequencyLight {
 public:
  // Errors: those of ProjectEnvironment.
  [[nodiscard]] static absl::StatusOr<FrequencyLight> Create(const Environment& environment, int n,
                                                             ShWindow window = ShWindow::kNone);
  // `coefficients` [n][3], n a legal count.
  explicit FrequencyLight(Eigen::MatrixXd coefficients);

  [[nodiscard]] int num_functions() const { return static_cast<int>(coefficients_.rows()); }
  [[nodiscard]] const Eigen::MatrixXd& coefficients() const { return coefficients_; }

  // R c_e, [n][3]: the light by directions of a frame whose axes t, b and n are the rows of
  // `local_from_world`, orthonormal and right-handed. A few microseconds.
  [[nodiscard]] Eigen::MatrixXd InFrame(const Eigen::Matrix3d& local_from_world) const;

 private:
  Eigen::MatrixXd coefficients_;
};

// Radiance, before the clamp at 0, of BTFels turned by `turns` quarter turns, as a function of their
// coefficients. `view` is a unit vector in the surface's frame, in which `light` [n][3] is (InFrame). No runs
// where the view is at or below the horizon. Cost: n times that of Decoder::Form; the decoder's first call
// integrates.
[[nodiscard]] LinearForm RadianceForm(const Decoder& decoder, const Eigen::Vector3d& view,
                                      const Eigen::MatrixXd& light, int turns);

}  // namespace tessera
