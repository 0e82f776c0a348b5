#include "btf/codec/dfmf/sample_matrix.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/encoder_input.h"

namespace tessera {
namespace {

constexpr uint64_t kSeed = 0x64666d66;

}  // namespace

absl::StatusOr<Eigen::Matrix3d> ColourMoments(const BtfInfo& info, RowPasses& passes,
                                              const RunContext& context) {
  const Eigen::Index pairs = static_cast<Eigen::Index>(info.views.size() * info.lights.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  TESSERA_RETURN_IF_ERROR(passes.Run([&](const SampleBlock& block) -> absl::Status {
    std::vector<Eigen::Matrix3d> of_rows(block.num_rows, Eigen::Matrix3d::Zero());
    ParallelFor(context, 0, block.num_rows, 1, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row) {
        for (int64_t x = 0; x < info.width; ++x) {
          const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3>> rgb(
              block.samples.data() + (row * info.width + x) * 3 * pairs, pairs, 3);
          for (int i = 0; i < 3; ++i) {
            for (int j = 0; j <= i; ++j) {
              of_rows[row](i, j) += static_cast<double>(rgb.col(i).dot(rgb.col(j)));
            }
          }
        }
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    for (const Eigen::Matrix3d& row : of_rows) {
      // One look at the sums clears almost every row; NaN fails every comparison.
      if (!(row.trace() <= static_cast<double>(kLargestSample) * kLargestSample) &&
          !std::ranges::all_of(block.samples, IsLegalSample)) {
        return IllegalSampleError(info, block.row, block.samples);
      }
      moments += row;
    }
    return absl::OkStatus();
  }));
  return Eigen::Matrix3d(moments.selfadjointView<Eigen::Lower>());
}

Eigen::Matrix3f ColourAxes(const Eigen::Matrix3d& moments) {
  if (moments.trace() <= 0.0) {
    return Eigen::Matrix3f::Identity();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments / moments.trace());
  Eigen::Matrix3d axes = eigen.eigenvectors().rowwise().reverse();
  for (int j = 0; j < 3; ++j) {
    axes.col(j) *= axes.col(j).sum() < 0.0 ? -1.0 : 1.0;
  }
  return axes.cast<float>();
}

void SampleMatrix::Rotate(const SampleBlock& block) const {
  constexpr int64_t kTexelsPerTask = 8;
  ParallelFor(context_, 0, block.num_texels, kTexelsPerTask, [&](int64_t begin, int64_t end) {
    for (int64_t texel = begin; texel < end; ++texel) {
      float* const x = block.samples.data() + texel * 3 * pairs_;
      for (Eigen::Index i = 0; i < pairs_; ++i) {
        const float r = x[i];
        const float g = x[i + pairs_];
        const float b = x[i + 2 * pairs_];
        for (int j = 0; j < 3; ++j) {
          x[i + j * pairs_] = axes_(0, j) * r + axes_(1, j) * g + axes_(2, j) * b;
        }
      }
    }
  });
}

Eigen::MatrixXf SampleMatrix::Project(const Part& a, const Eigen::MatrixXf& v) const {
  Eigen::MatrixXf t(v.cols(), a.cols());
  constexpr int64_t kTexelsPerTask = 64;
  const int64_t per_row = (width_ + kTexelsPerTask - 1) / kTexelsPerTask;
  ParallelFor(context_, 0, a.cols() / width_ * per_row, 1, [&](int64_t task, int64_t /*end*/) {
    const int64_t x = task % per_row * kTexelsPerTask;
    const int64_t begin = task / per_row * width_ + x;
    const int64_t count = std::min(kTexelsPerTask, width_ - x);
    t.middleCols(begin, count).noalias() = v.transpose() * a.middleCols(begin, count);
  });
  return t;
}

void SampleMatrix::AddGramProduct(const Part& a, const Eigen::MatrixXf& v, Eigen::MatrixXf& product) const {
  const Eigen::MatrixXf t = Project(a, v);
  constexpr int64_t kPairsPerTask = 512;
  constexpr int64_t kTexelsPerSum = 256;
  ParallelFor(context_, 0, a.rows(), kPairsPerTask, [&](int64_t begin, int64_t end) {
    for (int64_t row = 0; row < a.cols(); row += width_) {
      for (int64_t x = 0; x < width_; x += kTexelsPerSum) {
        const int64_t count = std::min(kTexelsPerSum, width_ - x);
        product.middleRows(begin, end - begin).noalias() +=
            a.block(begin, row + x, end - begin, count) * t.middleCols(row + x, count).transpose();
      }
    }
  });
}

absl::StatusOr<Spaces> FindSpaces(const SampleMatrix& matrix, Eigen::Index pairs, int luma_rank,
                                  int chroma_rank, RowPasses& passes) {
  BlockLanczos luma(pairs, luma_rank, kSeed);
  BlockLanczos chroma(2 * pairs, chroma_rank, kSeed);
  for (int pass = 0; pass < kLanczosPasses && !(luma.is_complete() && chroma.is_complete()); ++pass) {
    Eigen::MatrixXf luma_product = Eigen::MatrixXf::Zero(pairs, luma.block().cols());
    Eigen::MatrixXf chroma_product = Eigen::MatrixXf::Zero(2 * pairs, chroma.block().cols());
    TESSERA_RETURN_IF_ERROR(passes.Run([&](const SampleBlock& block) {
      matrix.Rotate(block);
      if (!luma.is_complete()) {
        matrix.AddGramProduct(matrix.Luma(block), luma.block(), luma_product);
      }
      if (!chroma.is_complete()) {
        matrix.AddGramProduct(matrix.Chroma(block), chroma.block(), chroma_product);
      }
      return absl::OkStatus();
    }));
    if (!luma.is_complete()) {
      luma.Add(luma_product);
    }
    if (!chroma.is_complete()) {
      chroma.Add(chroma_product);
    }
  }
  return Spaces{luma.Leading(luma_rank), chroma.Leading(chroma_rank)};
}

}  // namespace tessera
