// The matrix of samples that "dfmf" factorises, a block of rows of texels at a time: samples are turned into
// colour axes, luminance is [views * lights][texels], the two chrominances joined are [2 * views *
// lights][texels].
//
//   TESSERA_ASSIGN_OR_RETURN(const Eigen::Matrix3d moments, ColourMoments(info, passes, context));
//   const SampleMatrix matrix(info.width, pairs, ColourAxes(moments), context);
//   TESSERA_ASSIGN_OR_RETURN(const Spaces spaces, FindSpaces(matrix, pairs, 32, 16, passes));
#pragma once

#include <cstdint>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/run_context.h"
#include "btf/codec/row_passes.h"
#include "btf/data/btf_source.h"
#include "btf/math/truncated_svd.h"

namespace tessera {

// Passes of FindSpaces over the rows, at most.
inline constexpr int kLanczosPasses = 3;

// Second moments of RGB over all samples, in one pass. Errors: INVALID_ARGUMENT naming the first illegal
// sample (encoder_input.h), RowPasses::Run's.
[[nodiscard]] absl::StatusOr<Eigen::Matrix3d> ColourMoments(const BtfInfo& info, RowPasses& passes,
                                                            const RunContext& context);

// Principal axes of the moments as columns, in falling order, signed so that the sum of each is >= 0; float,
// as they are stored. The identity when all samples are black.
[[nodiscard]] Eigen::Matrix3f ColourAxes(const Eigen::Matrix3d& moments);

// Borrows the context.
class SampleMatrix {
 public:
  using Part = Eigen::Map<const Eigen::MatrixXf, 0, Eigen::OuterStride<>>;

  // `width` texels a row, `pairs` = views * lights.
  SampleMatrix(int64_t width, Eigen::Index pairs, const Eigen::Matrix3f& axes, const RunContext& context)
      : width_(width), pairs_(pairs), axes_(axes), context_(context) {}

  // Turns the block's samples into colour axes, in place.
  void Rotate(const SampleBlock& block) const;
  // Of a turned block, [pairs][texels] and [2 pairs][texels].
  [[nodiscard]] Part Luma(const SampleBlock& block) const {
    return {block.samples.data(), pairs_, block.num_texels, Eigen::OuterStride<>(3 * pairs_)};
  }
  [[nodiscard]] Part Chroma(const SampleBlock& block) const {
    return {block.samples.data() + pairs_, 2 * pairs_, block.num_texels, Eigen::OuterStride<>(3 * pairs_)};
  }

  // v^T a, [columns of v][texels]. Products are cut at rows of texels, so that neither the budget nor threads
  // change a sum.
  [[nodiscard]] Eigen::MatrixXf Project(const Part& a, const Eigen::MatrixXf& v) const;
  // product += a (v^T a)^T. Each task sums its own rows of the product, texels in their order.
  void AddGramProduct(const Part& a, const Eigen::MatrixXf& v, Eigen::MatrixXf& product) const;

 private:
  int64_t width_;
  Eigen::Index pairs_;
  Eigen::Matrix3f axes_;
  const RunContext& context_;
};

struct Spaces {
  SingularSpace luma;    // vectors [views * lights][rank]
  SingularSpace chroma;  // vectors [2 * views * lights][rank]
};

// The leading singular vectors, by block Lanczos (math/truncated_svd.h): fewer than asked for where there are
// fewer. Errors: RowPasses::Run's.
[[nodiscard]] absl::StatusOr<Spaces> FindSpaces(const SampleMatrix& matrix, Eigen::Index pairs, int luma_rank,
                                                int chroma_rank, RowPasses& passes);

}  // namespace tessera
