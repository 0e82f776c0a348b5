// How like itself a field of embedding points is at every shift.
#pragma once

#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/tiles/exemplar.h"

namespace tessera {

// Points of the embedding, one a pixel; they belong to an exemplar.
struct PointField {
  int width = 0;
  int height = 0;
  std::vector<const float*> points;  // [height][width]
};

// The unturned exemplar.
[[nodiscard]] PointField FieldOfExemplar(const Exemplar& exemplar);

class Autocorrelation {
 public:
  // Of the first `dims` dimensions together, about the mean, of the pixels that overlap; 1 at no shift, 0
  // everywhere for a constant field. With `shrink` above 1 the field is averaged down by it first, and shifts
  // count averaged pixels. Needs 0 <= most_x < width / shrink, likewise most_y. Errors: CANCELLED. Cost: an
  // FFT of the padded field for each two dimensions.
  [[nodiscard]] static absl::StatusOr<Autocorrelation> Of(const PointField& field, int dims, int shrink,
                                                          int most_x, int most_y, const RunContext& context);

  [[nodiscard]] int most_x() const { return most_x_; }
  [[nodiscard]] int most_y() const { return most_y_; }
  // At a shift by dx columns right and dy rows down, at most most_x and most_y either way.
  [[nodiscard]] double at(int dx, int dy) const {
    if (dy < 0) {
      dx = -dx;
      dy = -dy;
    }
    return values_[static_cast<size_t>(dy) * (2 * most_x_ + 1) + most_x_ + dx];
  }

 private:
  int most_x_ = 0;
  int most_y_ = 0;
  std::vector<double> values_;  // [dy 0..most_y][dx -most_x..most_x]
};

}  // namespace tessera
