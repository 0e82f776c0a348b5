#include "btf/tiles/seam_embedding.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
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
constexpr int kMostRows = 64;  // that an image's spread is measured in
// Of the mean spread over all images, added to each: an image that is nearly black counts little.
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

// The root mean square distance of the image's RGB from their mean, in all four turns, over some rows.
double Spread(const Material& material, const Decoder& decoder, const WeightedImage& image) {
  const int width = material.width;
  const auto k = static_cast<size_t>(material.btfels.num_coefficients);
  const int num_rows = std::min(kMostRows, material.height);
  Eigen::Matrix3Xf rgb(3, width);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0.0;
  for (int i = 0; i < num_rows; ++i) {
    const auto row = static_cast<size_t>(int64_t{i} * material.height / num_rows);
    const auto codes = std::span(material.btfels.codes).subspan(row * width * k, width * k);
    for (int turns = 0; turns < 4; ++turns) {
      decoder.DecodeTexels(codes, image.light, image.view, turns, {rgb.data(), size_t{3} * width});
      sum += rgb.cast<double>().rowwise().sum();
      squares += rgb.cast<double>().squaredNorm();
    }
  }
  const double count = 4.0 * num_rows * width;
  return std::sqrt(std::max(0.0, squares / count - (sum / count).squaredNorm()));
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
  std::vector<double> spreads(images.size());
  ParallelFor(context, 0, static_cast<int64_t>(images.size()), 1,
              [&](int64_t i, int64_t) { spreads[i] = Spread(material, *decoder, images[i]); });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  const double mean =
      std::accumulate(spreads.begin(), spreads.end(), 0.0) / static_cast<double>(spreads.size());
  for (size_t i = 0; i < images.size(); ++i) {
    images[i].weight = mean > 0.0 ? mean / (spreads[i] + kDarkShare * mean) : 1.0;
  }
  return EmbedImages(material, images, dims, context);
}

}  // namespace tessera
