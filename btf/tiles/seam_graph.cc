#include "btf/tiles/seam_graph.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

// Under SeamRule::kExcess, what a broken continuation costs beside a step that shows at once. At 0 cuts end
// features wherever the texels on both sides happen to be alike; at 1 they avoid that at any price.
constexpr float kContinuity = 0.15f;

// Of the seam between a and b, from the mismatches of its two texels, summed, and the own steps of its two
// patches, summed.
int SeamCost(const Exemplar& exemplar, uint32_t a, uint32_t b, float mismatch, float step) {
  float visible = mismatch;
  if (exemplar.seam_rule() == SeamRule::kExcess) {
    const float expected_excess = std::sqrt(step * step + mismatch * mismatch) - step;
    visible = std::max(0.0f, 2.0f * exemplar.Distance(a, b) - step) + kContinuity * expected_excess;
  }
  const double cost = visible * (kCostPerStep * exemplar.mean_steps_per_unit());
  return static_cast<int>(std::min(cost + 0.5, double{kMaxPairCost}));  // rounded
}

float Mismatch(const Exemplar& exemplar, uint32_t a, uint32_t b) {
  return a == b ? 0.0f : exemplar.Distance(a, b);
}

}  // namespace

int PairCost(const Exemplar& exemplar, uint32_t a, uint32_t b, int direction) {
  const uint32_t a_at_b = exemplar.Step(a, direction);
  if (a_at_b == b) {
    return 0;
  }
  const uint32_t b_at_a = exemplar.Step(b, direction ^ 2);
  const auto cost = [&](float mismatch, float step) { return SeamCost(exemplar, a, b, mismatch, step); };
  if (a_at_b == kNoTexel && b_at_a == kNoTexel) {
    return cost(2.0f * Mismatch(exemplar, a, b), 0.0f);
  }
  if (a_at_b == kNoTexel) {
    return cost(2.0f * Mismatch(exemplar, a, b_at_a), 2.0f * exemplar.StepLength(b, direction ^ 2));
  }
  if (b_at_a == kNoTexel) {
    return cost(2.0f * Mismatch(exemplar, a_at_b, b), 2.0f * exemplar.StepLength(a, direction));
  }
  return cost(Mismatch(exemplar, a, b_at_a) + Mismatch(exemplar, a_at_b, b),
              exemplar.StepLength(a, direction) + exemplar.StepLength(b, direction ^ 2));
}

float OwnStep(const Exemplar& exemplar, uint32_t a, uint32_t b, int direction) {
  const bool a_goes_on = exemplar.Step(a, direction) != kNoTexel;
  const bool b_goes_on = exemplar.Step(b, direction ^ 2) != kNoTexel;
  const float sum = exemplar.StepLength(a, direction) + exemplar.StepLength(b, direction ^ 2);
  return a_goes_on && b_goes_on ? 0.5f * sum : sum;
}

Canvas::Canvas(const Exemplar& exemplar, int width, int height)
    : exemplar_(&exemplar),
      width_(width),
      height_(height),
      num_unfilled_(width * height),
      texels_(static_cast<size_t>(width) * height, kNoTexel),
      fixed_(texels_.size(), 0),
      right_(texels_.size(), 0),
      down_(texels_.size(), 0) {}

void Canvas::Set(int x, int y, uint32_t texel) {
  const size_t index = Index(x, y);
  num_unfilled_ += (texel == kNoTexel ? 1 : 0) - (texels_[index] == kNoTexel ? 1 : 0);
  texels_[index] = texel;
  const auto cost = [&](int other_x, int other_y, int direction) {
    const uint32_t other = this->texel(other_x, other_y);
    return texel == kNoTexel || other == kNoTexel ? 0 : PairCost(*exemplar_, texel, other, direction);
  };
  if (x + 1 < width_) {
    right_[index] = cost(x + 1, y, GridCut::kRight);
  }
  if (y + 1 < height_) {
    down_[index] = cost(x, y + 1, GridCut::kDown);
  }
  if (x > 0) {
    right_[index - 1] = cost(x - 1, y, GridCut::kLeft);
  }
  if (y > 0) {
    down_[index - width_] = cost(x, y - 1, GridCut::kUp);
  }
}

int Canvas::TexelCost(int x, int y) const {
  int cost = std::max(right_cost(x, y), down_cost(x, y));
  if (x > 0) {
    cost = std::max(cost, right_cost(x - 1, y));
  }
  if (y > 0) {
    cost = std::max(cost, down_cost(x, y - 1));
  }
  return cost;
}

Canvas::Totals Canvas::Measure() const {
  Totals totals;
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      const auto add = [&](int cost, int other_x, int other_y, int direction) {
        if (fixed(x, y) && fixed(other_x, other_y)) {
          return;
        }
        totals.cost += cost;
        totals.largest_cost = std::max(totals.largest_cost, cost);
        const uint32_t here = texel(x, y);
        const uint32_t there = texel(other_x, other_y);
        if (here != kNoTexel && there != kNoTexel && exemplar_->Step(here, direction) != there) {
          ++totals.num_seams;
          totals.step += exemplar_->Distance(here, there);
          totals.own_step += OwnStep(*exemplar_, here, there, direction);
        }
      };
      if (x + 1 < width_) {
        add(right_cost(x, y), x + 1, y, GridCut::kRight);
      }
      if (y + 1 < height_) {
        add(down_cost(x, y), x, y + 1, GridCut::kDown);
      }
    }
  }
  return totals;
}

const PatchCut& PatchCutter::Cut(const Canvas& canvas, const Window& window, const Patch& patch,
                                 int64_t most_change) {
  const Exemplar& exemplar = canvas.exemplar();
  const int width = window.width;
  const int height = window.height;
  cut_ = PatchCut{};
  cut_.takes_new.assign(static_cast<size_t>(width) * height, 0);
  new_texels_.resize(cut_.takes_new.size());
  distance_.assign(cut_.takes_new.size(), 0.0f);
  grid_.Reset(width, height);
  // Texels of a patch lie at even distances.
  const uint32_t first = exemplar.TexelAt(patch.turn, patch.u, patch.v);
  const uint32_t right = exemplar.TexelAt(patch.turn, patch.u + 1, patch.v) - first;
  const uint32_t down = exemplar.TexelAt(patch.turn, patch.u, patch.v + 1) - first;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const size_t index = static_cast<size_t>(y) * width + x;
      const uint32_t old_texel = canvas.texel(window.x + x, window.y + y);
      new_texels_[index] = first + x * right + y * down;
      if (old_texel == kNoTexel) {
        grid_.AddTerminals(x, y, GridCut::kPinned, 0);
      } else {
        distance_[index] = Mismatch(exemplar, old_texel, new_texels_[index]);
        if (canvas.fixed(window.x + x, window.y + y)) {
          grid_.AddTerminals(x, y, 0, GridCut::kPinned);
        }
      }
    }
  }

  // Source side takes the new texel, sink side keeps the old one: what old seams would save is little beside
  // what the window's border costs, so little is pushed. `constant` collects what the reduction
  // takes out of the terminals; the cost before is `before`.
  int64_t constant = 0;
  int64_t before = 0;
  const auto add_unary = [&](int x, int y, int cost_if_new) {
    grid_.AddTerminals(x, y, std::max(0, -cost_if_new), std::max(0, cost_if_new));
    constant += std::min(0, cost_if_new);
  };
  // Mixed cost of old `from` beside new `to`: mismatch at both, which is the distance there unless an old
  // seam lies between.
  const auto mixed = [&](uint32_t old_here, uint32_t old_there, int direction, size_t here, size_t there) {
    const uint32_t continued = exemplar.Step(old_here, direction);
    const uint32_t new_there = new_texels_[there];
    const float new_step = exemplar.StepLength(new_texels_[here], direction);
    if (continued == kNoTexel) {
      return SeamCost(exemplar, old_here, new_there, 2.0f * distance_[here], 2.0f * new_step);
    }
    const float beyond = continued == old_there ? distance_[there] : Mismatch(exemplar, continued, new_there);
    return SeamCost(exemplar, old_here, new_there, distance_[here] + beyond,
                    exemplar.StepLength(old_here, direction) + new_step);
  };
  const auto add_pair = [&](int x, int y, int direction, int other_x, int other_y, int old_cost) {
    const size_t here = static_cast<size_t>(y) * width + x;
    const size_t there = static_cast<size_t>(other_y) * width + other_x;
    const uint32_t old_here = canvas.texel(window.x + x, window.y + y);
    const uint32_t old_there = canvas.texel(window.x + other_x, window.y + other_y);
    const int old_new = old_here == kNoTexel ? 0 : mixed(old_here, old_there, direction, here, there);
    const int new_old = old_there == kNoTexel ? 0 : mixed(old_there, old_here, direction ^ 2, there, here);
    before += old_cost;
    constant += old_cost;
    add_unary(x, y, new_old - old_cost);
    add_unary(other_x, other_y, -new_old);
    int edge = old_new + new_old - old_cost;
    if (edge < 0) {
      edge = 0;
      ++cut_.num_truncated;
    }
    grid_.SetEdge(x, y, static_cast<GridCut::Direction>(direction), 0, edge);
  };
  const auto add_outside = [&](int x, int y, int direction, int other_x, int other_y, int old_cost) {
    const uint32_t outside = canvas.texel(other_x, other_y);
    if (outside == kNoTexel) {
      return;
    }
    const int new_cost =
        PairCost(exemplar, new_texels_[static_cast<size_t>(y) * width + x], outside, direction);
    before += old_cost;
    constant += old_cost;
    add_unary(x, y, new_cost - old_cost);
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int canvas_x = window.x + x;
      const int canvas_y = window.y + y;
      if (x + 1 < width) {
        add_pair(x, y, GridCut::kRight, x + 1, y, canvas.right_cost(canvas_x, canvas_y));
      } else if (canvas_x + 1 < canvas.width()) {
        add_outside(x, y, GridCut::kRight, canvas_x + 1, canvas_y, canvas.right_cost(canvas_x, canvas_y));
      }
      if (y + 1 < height) {
        add_pair(x, y, GridCut::kDown, x, y + 1, canvas.down_cost(canvas_x, canvas_y));
      } else if (canvas_y + 1 < canvas.height()) {
        add_outside(x, y, GridCut::kDown, canvas_x, canvas_y + 1, canvas.down_cost(canvas_x, canvas_y));
      }
      if (x == 0 && canvas_x > 0) {
        add_outside(x, y, GridCut::kLeft, canvas_x - 1, canvas_y, canvas.right_cost(canvas_x - 1, canvas_y));
      }
      if (y == 0 && canvas_y > 0) {
        add_outside(x, y, GridCut::kUp, canvas_x, canvas_y - 1, canvas.down_cost(canvas_x, canvas_y - 1));
      }
    }
  }
  cut_.cost_change = grid_.Solve(most_change - constant + before) + constant - before;
  if (cut_.cost_change >= most_change) {
    return cut_;
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const size_t index = static_cast<size_t>(y) * width + x;
      const bool is_new =
          grid_.OnSourceSide(x, y) && canvas.texel(window.x + x, window.y + y) != new_texels_[index];
      cut_.takes_new[index] = is_new ? 1 : 0;
      cut_.num_new += is_new ? 1 : 0;
    }
  }
  return cut_;
}

void PatchCutter::Apply(const Window& window, const Patch& patch, const PatchCut& cut, Canvas& canvas) {
  for (int y = 0; y < window.height; ++y) {
    for (int x = 0; x < window.width; ++x) {
      if (cut.takes_new[static_cast<size_t>(y) * window.width + x] != 0) {
        canvas.Set(window.x + x, window.y + y,
                   canvas.exemplar().TexelAt(patch.turn, patch.u + x, patch.v + y));
      }
    }
  }
}

}  // namespace tessera
