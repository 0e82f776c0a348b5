// The leading right singular vectors of a matrix that is only seen a part at a time, by block Lanczos
// iteration on S = A^T A with full reorthogonalisation.
//
//   BlockLanczos lanczos(/*size=*/n, /*block_size=*/32, /*seed=*/1);
//   for (int pass = 0; pass < 3 && !lanczos.is_complete(); ++pass) {
//     product = sum over parts of A of part^T (part lanczos.block());     // [n][lanczos.block().cols()]
//     lanczos.Add(product);
//   }
//   SingularSpace leading = lanczos.Leading(16);
//
// Each pass adds one block of the Krylov space of S, and the answer is the best within all of them
// (Rayleigh-Ritz), so three passes do what subspace iteration needs several more for. Source: Golub and
// Underwood 1977 ("The block Lanczos method for computing eigenvalues"); Musco and Musco 2015 (NIPS,
// "Randomized block Krylov methods") for the bounds from a random first block.
#pragma once

#include <cstdint>

#include <Eigen/Core>

namespace tessera {

struct SingularSpace {
  Eigen::MatrixXd vectors;  // [n][rank], orthonormal columns; the largest element of each is positive
  Eigen::VectorXd values;   // [rank], singular values, falling, >= 0
};

// Not thread-safe. Deterministic: the same products give the same vectors.
class BlockLanczos {
 public:
  // size >= 1, block_size >= 1; blocks are no wider than what is left of the space.
  BlockLanczos(Eigen::Index size, Eigen::Index block_size, uint64_t seed);

  // Orthonormal columns, [size][at most block_size]; none once is_complete().
  [[nodiscard]] const Eigen::MatrixXf& block() const { return block_; }
  // Whether the space holds every direction that S reaches from it: more products add nothing.
  [[nodiscard]] bool is_complete() const { return block_.cols() == 0; }

  // Takes S block() and makes the next block. `product` is finite, [size][block().cols()].
  void Add(const Eigen::MatrixXf& product);

  // At most `rank` vectors, fewer where the space so far has fewer. Cost: O(size m^2) for the m columns
  // added.
  [[nodiscard]] SingularSpace Leading(Eigen::Index rank) const;

 private:
  // Appends the orthonormalised part of `candidates` that is new to the space, and sets block_ to it.
  void Extend(Eigen::MatrixXd candidates);

  Eigen::Index size_;
  Eigen::Index block_size_;
  Eigen::MatrixXd basis_;     // [size][m + block]
  Eigen::MatrixXd products_;  // [size][m]
  Eigen::MatrixXf block_;
};

}  // namespace tessera
