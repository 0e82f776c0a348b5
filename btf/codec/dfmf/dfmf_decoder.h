// Decoding of "dfmf": one low-rank factorisation of the whole (view, light) x texel matrix, luminance and
// chrominance apart.
//
//   s0 = sum over i < r of w_i(light, view) value[i]
//   sj = sum over i < q of w_ji(light, view) value[r + i]      j = 1, 2
//   rgb[c] = sum over j of colour[c][j] sj
//
// The angular factors w are stored at the measured directions, resampled to the grids of direction_grid.h
// when first needed, and interpolated there; beyond the measured angles as codec/FORMAT.md says. Source:
// ours, after the full matrix factorisation of Koudelka et al. 2003 and Mueller et al. 2004 (Bonn).
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"
#include "btf/codec/decoder.h"
#include "btf/codec/dfmf/direction_grid.h"

namespace tessera {

inline constexpr int kDfmfVersion = 2;

// Limits of what is decoded: nodes along the side of a grid, directions of a set (resampling solves a system
// of that size), and values of the resampled factors, 1 GiB of them.
inline constexpr int kMaxGridNodesPerSide = 41;
inline constexpr int64_t kMaxDfmfDirections = 2048;
inline constexpr int64_t kMaxResampledFactors = int64_t{1} << 28;

// Names of the tables; those of chrominance are absent where its rank is 0.
inline constexpr char kDfmfColour[] = "colour";               // f32 [3][3], [channel][component]
inline constexpr char kDfmfLuma[] = "luma";                   // u8 or u16 [views][lights][r]
inline constexpr char kDfmfLumaOffset[] = "luma_offset";      // f32 [r]
inline constexpr char kDfmfLumaStep[] = "luma_step";          // f32 [r]
inline constexpr char kDfmfChroma[] = "chroma";               // u8 or u16 [2][views][lights][q]
inline constexpr char kDfmfChromaOffset[] = "chroma_offset";  // f32 [2][q]
inline constexpr char kDfmfChromaStep[] = "chroma_step";      // f32 [2][q]

class DfmfDecoder final : public Decoder {
 public:
  // Errors: INVALID_ARGUMENT naming the table, parameter or direction set that is missing or misshapen.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<DfmfDecoder>> Create(const BtfelTable& table);

  [[nodiscard]] int luma_rank() const { return luma_rank_; }      // r
  [[nodiscard]] int chroma_rank() const { return chroma_rank_; }  // q
  // Angular factors of a pair of directions: r of luma, then q of each chroma.
  [[nodiscard]] int num_factors() const { return luma_rank_ + 2 * chroma_rank_; }
  // Column j: rgb of component j.
  [[nodiscard]] const Eigen::Matrix3d& colour() const { return colour_; }
  // Largest measured polar angles, in [0, pi/2].
  [[nodiscard]] double max_light_theta_rad() const { return light_.max_theta_rad; }
  [[nodiscard]] double max_view_theta_rad() const { return view_.max_theta_rad; }
  [[nodiscard]] const DirectionGrid& light_grid() const { return light_.grid; }
  [[nodiscard]] const DirectionGrid& view_grid() const { return view_.grid; }

  // The factors at pairs of nodes, [light node][view node][num_factors()]; made by the first call.
  [[nodiscard]] std::span<const float> grid() const;

  // Factors of a pair of directions with clamp, scale and horizon; false, and zeros, when one of them is at
  // or below the horizon. Directions are unit, in the unturned frame.
  bool Factors(const Eigen::Vector3d& light, const Eigen::Vector3d& view, std::span<double> factors) const;

  // Integrals of the lights' hats, as they decode, with each harmonic, [light nodes][kMaxShFunctions]. The
  // first call integrates.
  [[nodiscard]] const Eigen::MatrixXd& LightIntegrals() const;
  // The factors of a view under each of the first `n` harmonics of light, [num_factors()][n].
  [[nodiscard]] Eigen::MatrixXd FactorsUnderHarmonics(const DirectionGrid::Stencil& view, int n) const;

  [[nodiscard]] LinearForm Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const override;
  [[nodiscard]] std::vector<LinearForm> LightHarmonics(int n, const Eigen::Vector3d& view) const override;

 private:
  struct Side {  // lights or views
    std::vector<Direction> directions;
    double max_theta_rad;
    DirectionGrid grid;
    ResampleRule rule;
  };

  DfmfDecoder(const BtfelTable& table, Side light, Side view)
      : Decoder(table), light_(std::move(light)), view_(std::move(view)) {}
  // `name` is "light" or "view".
  static absl::StatusOr<Side> MakeSide(const std::vector<Direction>& directions, const std::string& name,
                                       const nlohmann::json& parameters);
  // Puts codes of factors, [views][lights][rank], into samples_ at `first` of every pair.
  void TakeFactors(std::span<const float> codes, std::span<const float> offset, std::span<const float> step,
                   int first);

  // Weights of coefficients from the factors of a pair.
  [[nodiscard]] LinearForm FormOf(std::span<const double> factors) const;

  int luma_rank_ = 0;
  int chroma_rank_ = 0;
  Eigen::Matrix3d colour_ = Eigen::Matrix3d::Identity();
  Side light_;
  Side view_;
  std::vector<float> samples_;  // [view][light][num_factors()]
  mutable std::once_flag is_resampled_;
  mutable std::vector<float> grid_;
  mutable std::once_flag is_integrated_;
  mutable Eigen::MatrixXd light_integrals_;
};

}  // namespace tessera
