// Decoding of "view-pca" [PCAWang 3, 4.4]: for each view v the mean texture over the lights and c
// eigen-textures, with a weight for each light and eigen-texture; between sampled directions barycentric
// weights of the three nearest views and lights (math/hemisphere_triangulation.h):
//
//   value = sum over s of wv_s [ mean(v_s) + sum over m = 1..c of (sum over r of wl_r a(v_s, l_r, m))
//   e_m(v_s) ]
//
// k index (view * 3 + channel) * (c + 1) + m, m = 0 the mean. So a light and view read the coefficients of
// three views at most, 3 (c + 1) each.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/decoder.h"
#include "btf/math/hemisphere_triangulation.h"

namespace tessera {

// The stored weights' codes: weight = (code - kZeroWeight) / kZeroWeight, code 0 .. 2 kZeroWeight.
inline constexpr int kZeroWeight = 32767;
// Of either kind. Bounds what a hostile file can ask for.
inline constexpr int kMaxViewPcaDirections = 4096;
inline constexpr int kMaxEigenTextures = 255;

class ViewPcaDecoder final : public Decoder {
 public:
  // Errors: INVALID_ARGUMENT naming the table, parameter or direction set that is missing, misshapen or
  // beyond its limit, or the number of coefficients when it is not 3 (c + 1) times the number of views.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<ViewPcaDecoder>> Create(const BtfelTable& table);

  [[nodiscard]] int num_eigen_textures() const { return num_eigen_textures_; }
  [[nodiscard]] int num_views() const { return num_views_; }
  [[nodiscard]] int num_lights() const { return num_lights_; }
  [[nodiscard]] const HemisphereInterpolator& lights() const { return lights_; }
  [[nodiscard]] const HemisphereInterpolator& views() const { return views_; }
  // a(view, light, m + 1), [views][lights][c].
  [[nodiscard]] const std::vector<float>& light_weights() const { return light_weights_; }

  // Integrals of the lights' hats, as they decode, with each harmonic, [lights][kMaxShFunctions]. The first
  // call integrates.
  [[nodiscard]] const Eigen::MatrixXd& LightIntegrals() const;

  [[nodiscard]] LinearForm Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const override;
  [[nodiscard]] std::vector<LinearForm> LightHarmonics(int n, const Eigen::Vector3d& view) const override;

 private:
  ViewPcaDecoder(const BtfelTable& table, int num_eigen_textures, HemisphereInterpolator lights,
                 HemisphereInterpolator views, std::vector<float> light_weights);

  // What a light beyond the largest measured angle is scaled by.
  [[nodiscard]] double LightScale(const Eigen::Vector3d& light) const;
  // Weights of coefficients under a sum of measured lights: indices, and a weight for each.
  [[nodiscard]] LinearForm FormOf(std::span<const int> lights, std::span<const double> light_weights,
                                  const Eigen::Vector3d& view) const;

  int num_eigen_textures_;
  int num_views_;
  int num_lights_;
  HemisphereInterpolator lights_;
  HemisphereInterpolator views_;
  std::vector<float> light_weights_;
  mutable std::once_flag is_integrated_;
  mutable Eigen::MatrixXd light_integrals_;
};

}  // namespace tessera
