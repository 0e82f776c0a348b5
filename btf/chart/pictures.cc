#include "btf/chart/pictures.h"

#include <algorithm>

#include "btf/base/parallel.h"
#include "btf/base/rng.h"
#include "btf/base/status_macros.h"
#include "btf/metrics/flip.h"
#include "btf/metrics/image_errors.h"
#include "btf/metrics/ssim.h"

namespace tessera {
namespace {

// Visits (view, light, class).
template <typename Visit>
void ForEachPair(const BtfInfo& info, const PairSet& pairs, Visit visit) {
  for (const int view : pairs.views) {
    for (const int light : pairs.lights) {
      visit(PicturePair{view, light, AngleClass(info.views[view], info.lights[light])});
    }
  }
}

}  // namespace

std::vector<PicturePair> ChoosePictures(const BtfInfo& info, const PairSet& pairs, int per_class) {
  std::array<std::vector<PicturePair>, kNumAngleLimits> classes;
  ForEachPair(info, pairs, [&](const PicturePair& pair) { classes[pair.angle_class].push_back(pair); });
  const auto index = [&](const PicturePair& pair) {
    return static_cast<uint64_t>(pair.view) * info.lights.size() + static_cast<uint64_t>(pair.light);
  };
  std::vector<PicturePair> chosen;
  for (std::vector<PicturePair>& members : classes) {
    std::ranges::sort(members, {}, [&](const PicturePair& pair) { return Mix64(index(pair)); });
    members.resize(std::min(members.size(), static_cast<size_t>(per_class)));
    std::ranges::sort(members, {}, index);
    chosen.insert(chosen.end(), members.begin(), members.end());
  }
  return chosen;
}

std::array<int64_t, kNumAngleLimits> PairsByClass(const BtfInfo& info, const PairSet& pairs) {
  std::array<int64_t, kNumAngleLimits> counts{};
  ForEachPair(info, pairs, [&](const PicturePair& pair) { ++counts[pair.angle_class]; });
  return counts;
}

absl::StatusOr<std::vector<Image>> ReadPictures(BtfSource& source, std::span<const PicturePair> pairs,
                                                const RunContext& context) {
  const BtfInfo& info = source.info();
  const size_t num_images = info.views.size() * info.lights.size();
  std::vector<Image> pictures(pairs.size(), Image(info.width, info.height, 3));
  std::vector<float> samples(source.SamplesPerRow());
  for (int y = 0; y < info.height; ++y) {
    TESSERA_RETURN_IF_ERROR(source.ReadRows(y, 1, samples, context));
    for (size_t i = 0; i < pairs.size(); ++i) {
      const size_t image = static_cast<size_t>(pairs[i].view) * info.lights.size() + pairs[i].light;
      float* const row = pictures[i].at(0, y);
      for (int sample = 0; sample < info.width * 3; ++sample) {
        row[sample] = samples[sample * num_images + image];
      }
    }
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  return pictures;
}

absl::StatusOr<std::array<PictureErrors, kNumAngleLimits>> ComparePictures(
    std::span<const Image> references, std::span<const PicturePair> pairs,
    const std::array<int64_t, kNumAngleLimits>& population, const PicturePredictor& predict,
    const RunContext& context) {
  for (const Image& reference : references) {
    TESSERA_RETURN_IF_ERROR(CheckComparable(reference, references[0]));
  }
  std::vector<PictureErrors> of_picture(pairs.size());
  ParallelFor(context, 0, static_cast<int64_t>(pairs.size()), 1, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      Image picture(references[i].width, references[i].height, 3);
      predict(static_cast<size_t>(i), picture);
      of_picture[i].dssim = Dssim(SrgbCoded(references[i]), SrgbCoded(picture));
      of_picture[i].flip = Flip(references[i], picture);
    }
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  std::array<PictureErrors, kNumAngleLimits> of_class{};
  for (size_t i = 0; i < pairs.size(); ++i) {
    PictureErrors& sum = of_class[pairs[i].angle_class];
    sum.dssim += of_picture[i].dssim;
    sum.flip += of_picture[i].flip;
    ++sum.num_pictures;
  }
  std::array<PictureErrors, kNumAngleLimits> up_to{};
  PictureErrors sum;
  double weight = 0.0;
  for (size_t c = 0; c < kNumAngleLimits; ++c) {
    if (of_class[c].num_pictures > 0) {
      const double share = static_cast<double>(population[c]) / of_class[c].num_pictures;
      sum.dssim += share * of_class[c].dssim;
      sum.flip += share * of_class[c].flip;
      sum.num_pictures += of_class[c].num_pictures;
      weight += static_cast<double>(population[c]);
    }
    if (weight > 0.0) {
      up_to[c] = {sum.dssim / weight, sum.flip / weight, sum.num_pictures};
    }
  }
  return up_to;
}

}  // namespace tessera
