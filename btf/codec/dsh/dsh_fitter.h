// Fits of groups of texels in two passes: over the lights of every view, then over the views of every light
// coefficient. Source: [Leung2007] 3.1, 5 and appendix.
//
// Everything is a large product of matrices: for a linear fit one a pass, for the constrained one two (onto
// the eigenvectors of the direction set, back to harmonics) and a vectorised search for lambda in between;
// nothing is solved for a single texel.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"

namespace tessera {

// Intermediate results of one group of texels, reused from group to group.
struct DshScratch {
  Eigen::MatrixXf projected;  // constrained: [signals, padded][kl], then [kv]
  Eigen::VectorXf energies;
  Eigen::MatrixXf view_samples;        // constrained: [views][(texel, channel, i)]
  Eigen::MatrixXf coefficients;        // constrained: [(texel, channel, i)][kv]
  Eigen::MatrixXf light_coefficients;  // linear: [kl][(texel, channel, view)]
};

// Immutable; each task brings its own scratch.
class DshFitter {
 public:
  virtual ~DshFitter() = default;

  // Groups are cut the same way for any budget and number of threads.
  [[nodiscard]] int64_t TexelsPerGroup() const;
  [[nodiscard]] size_t SamplesPerTexel() const { return static_cast<size_t>(3 * num_views_ * num_lights_); }
  [[nodiscard]] size_t CoefficientsPerTexel() const { return static_cast<size_t>(3 * kl_ * kv_); }

  // samples [texel][channel][view][light] -> coefficients [texel][(channel * kv + j) * kl + i]. False when a
  // sample is not legal (encoder_input.h); the coefficients are then undefined. Results of a texel depend on
  // nothing but its samples and the number of texels in its group.
  [[nodiscard]] virtual bool Fit(const float* samples, int num_texels, float* coefficients,
                                 DshScratch& scratch) const = 0;

 protected:
  DshFitter(Eigen::Index num_lights, Eigen::Index num_views, Eigen::Index kl, Eigen::Index kv)
      : num_lights_(num_lights), num_views_(num_views), kl_(kl), kv_(kv) {}

  Eigen::Index num_lights_;
  Eigen::Index num_views_;
  Eigen::Index kl_;
  Eigen::Index kv_;
};

// The plain harmonics at directions, [directions][n].
[[nodiscard]] Eigen::MatrixXd DshSamplesOfBasis(const std::vector<Direction>& directions, int n);

// Constrained least squares, closed form as in math/constrained_least_squares.h.
[[nodiscard]] std::unique_ptr<DshFitter> MakeConstrainedFitter(const BtfInfo& info,
                                                               const EncodeParams& params);

// light_fit [kl][lights] and view_fit [kv][views] map samples to coefficients.
[[nodiscard]] std::unique_ptr<DshFitter> MakeLinearFitter(const Eigen::MatrixXd& light_fit,
                                                          const Eigen::MatrixXd& view_fit);

}  // namespace tessera
