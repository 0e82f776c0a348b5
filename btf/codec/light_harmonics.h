// The light side of decoding in spherical harmonics: integrals over all directions of light, which decoders
// share (Decoder::LightHarmonics).
//
// Every codec decodes, under one view, a sum over functions g_j of the light alone: harmonics (dsh*), hats of
// a grid (dfmf) or of a triangulation (view-pca), extended over the sphere as codec/FORMAT.md says: clamped
// beyond the largest measured polar angle, scaled by the cosine there, zero at and below the horizon. What
// light in the frequency domain needs of them is
//
//   H(j, i) = integral over the sphere of g_j(light) Y_i(light),
//
// by Gauss-Legendre in the cosine, apart on either side of the largest measured angle, and evenly in azimuth.
// The result is the projection on the sphere of the extended function, discontinuous at the horizon: it is
// exact against light that Y_0 .. Y_n-1 hold, and no approximation of the function itself. Source:
// [Leung2007] 4.2, the matrix A there (differs: the extended functions, not the harmonics on the whole
// hemisphere).
#pragma once

#include <functional>
#include <span>

#include <Eigen/Core>

namespace tessera {

// Azimuths and polar angles of the quadrature, about: dense enough for hats that are a few degrees wide.
inline constexpr int kLightQuadratureDegree = 60;

// H, [num_functions][kMaxShFunctions]. `functions` fills `values` [num_functions], zeros at the call, with
// the functions at `light`, a unit vector above the horizon. Thousands of calls. Relative error below 1e-9
// for functions that are smooth on either side of max_theta_rad in [0, pi/2], 1e-3 for hats.
[[nodiscard]] Eigen::MatrixXd LightHarmonicIntegrals(
    int num_functions, double max_theta_rad,
    const std::function<void(const Eigen::Vector3d& light, std::span<double> values)>& functions);

}  // namespace tessera
