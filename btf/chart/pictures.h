// The pictures that DSSIM and FLIP are taken of: too costly for all pairs of a view and a light, so a fixed
// share of each class of angles stands for it.
//
//   const std::vector<PicturePair> chosen = ChoosePictures(info, MeasuredPairs(info, split), 32);
//   TESSERA_ASSIGN_OR_RETURN(std::vector<Image> references, ReadPictures(source, chosen, context));
//   TESSERA_ASSIGN_OR_RETURN(auto errors, ComparePictures(references, predict, strata, context));
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/chart/angle_limits.h"
#include "btf/data/btf_source.h"
#include "btf/image/image.h"
#include "btf/measure/pair_errors.h"

namespace tessera {

struct PicturePair {
  int view = 0;  // indices into the source's
  int light = 0;
  size_t angle_class = 0;
};

// Of the pairs in each class of angles, the `per_class` with the smallest Mix64(view * lights + light), all
// where there are fewer: the same everywhere, and without the pattern of every n-th. In order of class, then
// pair.
[[nodiscard]] std::vector<PicturePair> ChoosePictures(const BtfInfo& info, const PairSet& pairs,
                                                      int per_class);

// How many pairs of the set lie in each class.
[[nodiscard]] std::array<int64_t, kNumAngleLimits> PairsByClass(const BtfInfo& info, const PairSet& pairs);

// Whole pictures of the source, linear RGB. Reads the source once. Errors: those of the source; CANCELLED.
[[nodiscard]] absl::StatusOr<std::vector<Image>> ReadPictures(BtfSource& source,
                                                              std::span<const PicturePair> pairs,
                                                              const RunContext& context);

struct PictureErrors {
  double dssim = 0.0;
  double flip = 0.0;
  int num_pictures = 0;
};

// Fills the picture of pairs[index], linear RGB of the reference's shape. Called from several threads at
// once.
using PicturePredictor = std::function<void(size_t index, Image& picture)>;

// Up to each limit of angles: means over classes, each the mean of its pictures, weighted by the number of
// its pairs, so that the share of pictures taken of a class does not matter. `references` and `pairs` go
// together; at least one is expected of each class that `population` counts. Errors: INVALID_ARGUMENT
// (shapes); CANCELLED.
[[nodiscard]] absl::StatusOr<std::array<PictureErrors, kNumAngleLimits>> ComparePictures(
    std::span<const Image> references, std::span<const PicturePair> pairs,
    const std::array<int64_t, kNumAngleLimits>& population, const PicturePredictor& predict,
    const RunContext& context);

}  // namespace tessera
