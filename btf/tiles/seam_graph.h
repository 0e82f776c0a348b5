// A picture under synthesis, the cost of its seams, and the cut that lays a patch into it [Kwatra2003].
//
// The picture holds, for every texel, which exemplar texel it is. Two neighbours p, q with sources a, b are a
// seam where b does not continue a. With a' the exemplar texel that continues a at q, and b' the one that
// continues b at p, m = |a - b'| + |a' - b| in the embedding is the mismatch of the two patches at p and at
// q, and n = |a - a'| + |b' - b| are their own steps. Under SeamRule::kMismatch the seam costs m. Under
// kExcess it costs max(0, 2 |a - b| - n) + kContinuity (sqrt(n^2 + m^2) - n): by how much the step across the
// seam exceeds the material's own, which is what a certificate measures, and by how much it would if the
// mismatch had no particular direction, so that no feature ends only because the other side happens to look
// alike in one place. So cuts follow the edges that the material has of its own. Old seams need no memory of
// the patches that made them.
//
// Laying a patch chooses old or new for each texel of its window. Each pair is a 2 x 2 table of costs:
// old/old what the pair costs now, new/new 0, and the two mixed seams; reduced to unary terms and one
// directed edge [Kolmogorov2004], the grid keeps its four neighbours. Where both continuations exist and the
// mismatch is the cost, the table is submodular by the triangle inequality; elsewhere a negative edge is
// truncated to 0, which makes one mixed choice dearer than it is, and counted.
#pragma once

#include <cstdint>
#include <vector>

#include "btf/tiles/exemplar.h"
#include "btf/tiles/max_flow.h"

namespace tessera {

// Cost units of one mean step of the exemplar. 255 steps fill the range of a capacity.
inline constexpr int kCostPerStep = 128;
inline constexpr int kMaxPairCost = GridCut::kMaxCapacitySum / 2;

// Cost of the neighbours a and b, b lying in `direction` from a; 0 when b continues a. Symmetric. Where one
// continuation falls off the exemplar the other counts twice; where both do, |a - b| does, beside no step.
int PairCost(const Exemplar& exemplar, uint32_t a, uint32_t b, int direction);

// The mean of the steps, distances in the embedding, that the patches of such a seam have there of their own;
// the one there is where one continuation falls off the exemplar, 0 where both do.
float OwnStep(const Exemplar& exemplar, uint32_t a, uint32_t b, int direction);

// Half of what a pair costs, in mean steps: under kMismatch the average mismatch of its two texels.
constexpr double MismatchOfCost(double cost) {
  return cost / (2.0 * kCostPerStep);
}
// The inverse.
constexpr double CostOfMismatch(double mismatch) {
  return mismatch * (2.0 * kCostPerStep);
}

class Canvas {
 public:
  // All texels unfilled and free. `exemplar` must outlive the canvas.
  Canvas(const Exemplar& exemplar, int width, int height);

  [[nodiscard]] const Exemplar& exemplar() const { return *exemplar_; }
  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] uint32_t texel(int x, int y) const { return texels_[Index(x, y)]; }
  [[nodiscard]] bool filled(int x, int y) const { return texel(x, y) != kNoTexel; }
  [[nodiscard]] bool fixed(int x, int y) const { return fixed_[Index(x, y)] != 0; }
  [[nodiscard]] bool placed(int x, int y) const { return fixed_[Index(x, y)] == 2; }
  [[nodiscard]] const std::vector<uint32_t>& texels() const { return texels_; }
  [[nodiscard]] int num_unfilled() const { return num_unfilled_; }

  void Set(int x, int y, uint32_t texel);
  // A fixed texel is never replaced by a patch.
  void Fix(int x, int y) { fixed_[Index(x, y)] = 1; }
  // Sets and fixes a texel of a placed feature: what surrounds it need not look like it.
  void Place(int x, int y, uint32_t texel) {
    Set(x, y, texel);
    fixed_[Index(x, y)] = 2;
  }

  // Cost of the pair (x, y), (x + 1, y), and of (x, y), (x, y + 1); 0 while either is unfilled.
  [[nodiscard]] int right_cost(int x, int y) const { return right_[Index(x, y)]; }
  [[nodiscard]] int down_cost(int x, int y) const { return down_[Index(x, y)]; }
  // The dearest of the four pairs of a texel.
  [[nodiscard]] int TexelCost(int x, int y) const;

  struct Totals {
    int64_t cost = 0;       // over all pairs
    int64_t num_seams = 0;  // pairs that do not continue each other
    int largest_cost = 0;
    // Of the seams: their steps, and the mean of the two steps that the patches have there of their own.
    double step = 0.0;
    double own_step = 0.0;
  };
  // Pairs between two fixed texels are left out: nothing can change them.
  [[nodiscard]] Totals Measure() const;

 private:
  [[nodiscard]] size_t Index(int x, int y) const { return static_cast<size_t>(y) * width_ + x; }

  const Exemplar* exemplar_;
  int width_;
  int height_;
  int num_unfilled_;
  std::vector<uint32_t> texels_;
  std::vector<uint8_t> fixed_;  // 0 free, 1 fixed, 2 placed
  std::vector<int> right_, down_;
};

// A rectangle of the canvas.
struct Window {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

// A rectangle of the turned exemplar, the size of the window it is laid on.
struct Patch {
  int turn = 0;
  int u = 0;
  int v = 0;
};

// What laying a patch would do.
struct PatchCut {
  std::vector<uint8_t> takes_new;  // [window height][window width]
  // Of the canvas, pairs of newly filled texels included; at least the true change where tables were
  // truncated.
  int64_t cost_change = 0;
  int num_new = 0;        // texels whose source changes
  int num_truncated = 0;  // pairs whose table was not submodular
};

// More than any canvas costs.
inline constexpr int64_t kAnyChange = int64_t{1} << 60;

// Cuts patches into a canvas. Keeps scratch memory: one per thread.
class PatchCutter {
 public:
  // The cheapest choice of old and new in the window: fixed texels stay, unfilled ones become new. The patch
  // must lie inside its turned exemplar and the window inside the canvas. Where every choice changes the cost
  // by `most_change` or more, nothing is taken and cost_change is at least that.
  const PatchCut& Cut(const Canvas& canvas, const Window& window, const Patch& patch,
                      int64_t most_change = kAnyChange);

  static void Apply(const Window& window, const Patch& patch, const PatchCut& cut, Canvas& canvas);

 private:
  GridCut grid_;
  PatchCut cut_;
  std::vector<uint32_t> new_texels_;
  std::vector<float> distance_;  // |old - new| by texel of the window
};

}  // namespace tessera
