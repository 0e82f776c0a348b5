// Principal components of texels' features over the exemplar in all four quarter turns: what every embedding
// has in common.
//
// Turning a texel about the normal permutes its features, up to signs, so the covariance over four turns is
// made from that of one, and a turned texel's components come from the unturned features by a turned
// projection.
//
//   class MyFeatures : public TexelFeatures { ... };
//   TESSERA_ASSIGN_OR_RETURN(Embedding embedding, EmbedFeatures(width, height, features, dims, context));
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"

namespace tessera {

inline constexpr int kQuarterTurns = 4;

// What `turns` quarter turns of a texel, counter-clockwise, do to its features f: (R f)[a] = sign[a]
// f[source[a]]. Signed permutations; turns 0 is the identity, turns t and 4 - t are each other's inverse.
class FeatureTurns {
 public:
  // Entry `turns` of each is [F]; F features.
  FeatureTurns(std::array<std::vector<int>, kQuarterTurns> source,
               std::array<std::vector<double>, kQuarterTurns> sign);

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(source_[0].size()); }
  // R f.
  [[nodiscard]] Eigen::VectorXd Turn(int turns, const Eigen::VectorXd& f) const;
  // R^T f, the turn back.
  [[nodiscard]] Eigen::VectorXd TurnBack(int turns, const Eigen::VectorXd& f) const;
  // Column `column` of the mean over turns of R S R^T, S symmetric.
  void AverageTurns(const Eigen::MatrixXd& s, Eigen::Index column, Eigen::Ref<Eigen::VectorXd> average) const;

 private:
  std::array<std::vector<int>, kQuarterTurns> source_;
  std::array<std::vector<double>, kQuarterTurns> sign_;
};

// Texels as vectors of F features, and a linear weighting W of them: squared Euclidean distance of W f is the
// one to be embedded. The same values on every call.
class TexelFeatures {
 public:
  virtual ~TexelFeatures() = default;
  // Of weighted features.
  [[nodiscard]] virtual const FeatureTurns& turns() const = 0;
  // Features of unturned texels [begin, end), row-major in the exemplar, as the columns of `features`
  // [F][end - begin]. May be incomplete after a stop request.
  virtual void Compute(int64_t begin, int64_t end, Eigen::MatrixXf& features,
                       const RunContext& context) const = 0;
  // W v and W^T v, in place; the identity unless overridden. W is applied to the covariance, in double.
  virtual void Weight(Eigen::Ref<Eigen::VectorXd> v) const;
  virtual void WeightTransposed(Eigen::Ref<Eigen::VectorXd> v) const;
};

// As Codec::Embed for width x height texels (both >= 1); dims beyond F are not given, so result.dims =
// min(dims, F). Deterministic for any number of threads; the sign of a component makes the largest of its
// entries positive. Features are computed 2,048 texels at a time and kept; where they would take more than
// 512 MiB they are computed twice. Memory besides the result: two F x F matrices of doubles and those. Cost:
// one F x F covariance over all texels in float, then subspace iteration on it in double. Errors:
// INVALID_ARGUMENT (dims < 1), CANCELLED.
[[nodiscard]] absl::StatusOr<Embedding> EmbedFeatures(int width, int height, const TexelFeatures& features,
                                                      int dims, const RunContext& context);

}  // namespace tessera
