#include "btf/tiles/seam_embedding.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/codec/embedding.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

// Directions at one polar angle, evenly spaced: azimuths are a multiple of four, so that quarter turns of the
// first quarter give the rest.
struct Ring {
  double share = 1.0;  // of the widest polar angle
  int azimuths = 4;
};
// The azimuths of views grow about as the tangent of 25, 50 and 75 degrees, the usual widest angle.
constexpr Ring kViewRings[] = {{1.0 / 3.0, 4}, {2.0 / 3.0, 8}, {1.0, 24}};
constexpr Ring kLightRings[] = {{1.0 / 3.0, 4}, {1.0, 8}};
constexpr int kRowPairs = 32;  // that an image's mean step is measured in
// Of the mean step over all images, added to each: an image that is nearly black counts little.
constexpr double kDarkShare = 0.05;

double WidestAngle(const std::vector<Direction>& directions) {
  double widest = 0.0;
  for (const Direction& direction : directions) {
    widest = std::max(widest, direction.theta_rad);
  }
  return widest;
}

// All of the rings, or those in the first quarter.
std::vector<Eigen::Vector3d> DirectionsOf(std::span<const Ring> rings, double widest, bool first_quarter) {
  std::vector<Eigen::Vector3d> directions;
  for (const Ring& ring : rings) {
    const int count = first_quarter ? ring.azimuths / 4 : ring.azimuths;
    for (int i = 0; i < count; ++i) {
      directions.push_back(VectorFromDirection(
          {.theta_rad = ring.share * widest, .phi_rad = 2.0 * kPi * (i + 0.5) / ring.azimuths}));
    }
  }
  return directions;
}

// The mean distance of neighbours in the image in all four turns, over some pairs of rows.
double MeanStep(const Material& material, const Decoder& decoder, const WeightedImage& image) {
  const int width = material.width;
  const auto k = static_cast<size_t>(material.btfels.num_coefficients);
  const int num_pairs = std::min(kRowPairs, material.height - 1);
  std::vector<float> rgb(size_t{6} * width);
  double sum = 0.0;
  int64_t count = 0;
  const auto add = [&](int a, int b) {
    const Eigen::Map<const Eigen::Vector3f> p(rgb.data() + 3 * a);
    const Eigen::Map<const Eigen::Vector3f> q(rgb.data() + 3 * b);
    sum += (p - q).norm();
    ++count;
  };
  for (int pair = 0; pair < num_pairs; ++pair) {
    const auto row = static_cast<size_t>(int64_t{pair} * (material.height - 1) / num_pairs);
    const auto codes = std::span(material.btfels.codes).subspan(row * width * k, 2 * width * k);
    for (int turns = 0; turns < 4; ++turns) {
      decoder.DecodeTexels(codes, image.light, image.view, turns, rgb);
      for (int x = 0; x < width; ++x) {
        add(x, width + x);
        if (x + 1 < width) {
          add(x, x + 1);
        }
      }
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

}  // namespace

absl::StatusOr<Embedding> EmbedForSeams(const Material& material, int dims, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
  std::vector<WeightedImage> images;
  for (const Eigen::Vector3d& view : DirectionsOf(kViewRings, WidestAngle(material.btfels.views), true)) {
    for (const Eigen::Vector3d& light :
         DirectionsOf(kLightRings, WidestAngle(material.btfels.lights), false)) {
      images.push_back({light, view});
    }
  }
  std::vector<double> steps(images.size());
  ParallelFor(context, 0, static_cast<int64_t>(images.size()), 1,
              [&](int64_t i, int64_t) { steps[i] = MeanStep(material, *decoder, images[i]); });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  double mean = 0.0;
  for (const double step : steps) {
    mean += step / static_cast<double>(steps.size());
  }
  for (size_t i = 0; i < images.size(); ++i) {
    images[i].weight = mean > 0.0 ? mean / (steps[i] + kDarkShare * mean) : 1.0;
  }
  return EmbedImages(material, images, dims, context);
}

}  // namespace tessera
