// Two-dimensional transforms of real planes of size x size that are zero beyond a corner, as products with
// matrices of cosines and sines: at the sizes of regions (candidates.h) their arithmetic is dear but regular,
// and only what is not zero or is wanted takes part.
// Spectra are [2 size][channel][columns]: the real parts of all rows, then the imaginary parts; columns are
// those up to the Nyquist frequency.
#pragma once

#include <cmath>
#include <cstdint>

#include <Eigen/Core>

#include "btf/math/conventions.h"

namespace tessera {

// Immutable, shared by threads.
class FourierTransform {
 public:
  explicit FourierTransform(int size)
      : size_(size),
        down_(2 * size, 2 * size),
        across_cos_(size, columns()),
        across_sin_(size, columns()),
        back_cos_(size, columns()),
        back_sin_(size, columns()) {
    Eigen::ArrayXf cosine(size);
    Eigen::ArrayXf sine(size);
    for (int i = 0; i < size; ++i) {
      cosine[i] = static_cast<float>(std::cos(2.0 * kPi * i / size));
      sine[i] = static_cast<float>(std::sin(2.0 * kPi * i / size));
    }
    const auto angle = [size](int64_t x, int64_t frequency) {
      return static_cast<int>(x * frequency % size);
    };
    for (int x = 0; x < size; ++x) {
      for (int k = 0; k < size; ++k) {
        down_(k, x) = cosine[angle(x, k)];
        down_(k, size + x) = sine[angle(x, k)];
        down_(size + k, x) = -sine[angle(x, k)];
        down_(size + k, size + x) = cosine[angle(x, k)];
      }
      for (int k = 0; k < columns(); ++k) {
        // A column beyond the Nyquist frequency is the conjugate of one before it.
        const float weight =
            (k == 0 || 2 * k == size ? 1.0F : 2.0F) / (static_cast<float>(size) * static_cast<float>(size));
        across_cos_(x, k) = cosine[angle(x, k)];
        across_sin_(x, k) = -sine[angle(x, k)];
        back_cos_(x, k) = weight * cosine[angle(x, k)];
        back_sin_(x, k) = -weight * sine[angle(x, k)];
      }
    }
  }

  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] int columns() const { return size_ / 2 + 1; }

  // Of one channel, [height][width], into its columns of `lines`, [2 height][channel][columns].
  void Across(const Eigen::MatrixXf& plane, int channel, Eigen::MatrixXf& lines) const {
    const Eigen::Index height = plane.rows();
    lines.block(0, channel * columns(), height, columns()).noalias() =
        plane * across_cos_.topRows(plane.cols());
    lines.block(height, channel * columns(), height, columns()).noalias() =
        plane * across_sin_.topRows(plane.cols());
  }
  // Of all channels' lines.
  void Down(const Eigen::MatrixXf& lines, Eigen::MatrixXf& spectrum) const {
    const Eigen::Index height = lines.rows() / 2;
    spectrum.noalias() = down_.leftCols(height) * lines.topRows(height);
    spectrum.noalias() += down_.middleCols(size_, height) * lines.bottomRows(height);
  }
  // Of one channel's spectrum, the first rows and columns of its plane: [width][height].
  void Back(const Eigen::MatrixXf& spectrum, int width, int height, Eigen::MatrixXf& lines,
            Eigen::MatrixXf& plane) const {
    lines.resize(2 * height, columns());
    lines.topRows(height).noalias() = down_.leftCols(height).transpose() * spectrum;
    lines.bottomRows(height).noalias() = down_.middleCols(size_, height).transpose() * spectrum;
    plane.noalias() = back_cos_.topRows(width) * lines.topRows(height).transpose();
    plane.noalias() += back_sin_.topRows(width) * lines.bottomRows(height).transpose();
  }

 private:
  int size_;
  // [[cos, sin], [-sin, cos]] [frequency][row]; its transpose goes back.
  Eigen::MatrixXf down_;
  Eigen::MatrixXf across_cos_, across_sin_;  // [column][frequency]
  Eigen::MatrixXf back_cos_, back_sin_;      // likewise, weighted
};

}  // namespace tessera
