#include "btf/light/generated_environment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

namespace tessera {
namespace {

constexpr int kGeneratedHeight = 32;

using RadianceOf = std::function<Eigen::Array3d(const Eigen::Vector3d&)>;

Image PictureOfSky(const RadianceOf& radiance) {
  const TexelGrid grid(EnvironmentLayout::kEquirect, 2 * kGeneratedHeight, kGeneratedHeight);
  Image image(grid.width(), grid.height(), 3);
  for (int y = 0; y < grid.height(); ++y) {
    for (int x = 0; x < grid.width(); ++x) {
      const Eigen::Array3d rgb = radiance(grid.Direction(x, y));
      for (int channel = 0; channel < 3; ++channel) {
        image.at(x, y)[channel] = static_cast<float>(rgb[channel]);
      }
    }
  }
  return image;
}

// Blue above, a bright band at the horizon, brown below; brighter towards -z.
Eigen::Array3d Haze(const Eigen::Vector3d& d) {
  const double above = std::clamp(0.5 + 2.0 * d.y(), 0.0, 1.0);
  const double band = std::exp(-16.0 * d.y() * d.y());
  return (above * Eigen::Array3d(0.8, 1.1, 1.6) + (1.0 - above) * Eigen::Array3d(0.4, 0.3, 0.2) +
          0.9 * band) *
         (1.0 - 0.4 * d.z());
}

// Round lamps of 12 degrees about their centres.
Eigen::Array3d Lamps(const Eigen::Vector3d& d) {
  struct Lamp {
    Eigen::Vector3d place;
    Eigen::Array3d rgb;
  };
  static const std::array<Lamp, 4> kLamps = {{{{0.8, 0.7, 0.4}, {30, 28, 24}},
                                              {{-0.9, 0.3, 0.6}, {14, 16, 20}},
                                              {{0.1, 0.9, -0.5}, {22, 22, 22}},
                                              {{-0.3, -0.1, -1.0}, {16, 10, 6}}}};
  const double cosine = std::cos(0.21);
  for (const Lamp& lamp : kLamps) {
    if (lamp.place.normalized().dot(d) > cosine) {
      return lamp.rgb;
    }
  }
  return Eigen::Array3d(0.16, 0.15, 0.14) * (1.0 + 0.3 * d.y());
}

Image Sun() {
  Image image = PictureOfSky([](const Eigen::Vector3d& d) -> Eigen::Array3d { return 0.5 * Haze(d); });
  const TexelGrid grid(EnvironmentLayout::kEquirect, image.width, image.height);
  double power = 0.0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      power += image.at(x, y)[1] * grid.SolidAngle(x, y);
    }
  }
  const Eigen::Vector2d place = grid.Place(Eigen::Vector3d(0.6, 0.55, 0.58).normalized());
  const int x = static_cast<int>(place.x());
  const int y = static_cast<int>(place.y());
  const double radiance = power / grid.SolidAngle(x, y);
  const std::array<double, 3> white = {1.05, 1.0, 0.9};
  for (int channel = 0; channel < 3; ++channel) {
    image.at(x, y)[channel] = static_cast<float>(white[channel] * radiance);
  }
  return image;
}

}  // namespace

std::vector<std::string> GeneratedEnvironmentNames() {
  return {"sky", "studio", "sun"};
}

absl::StatusOr<Environment> GeneratedEnvironment(std::string_view name) {
  const EnvironmentOptions options{.layout = EnvironmentLayout::kEquirect};
  if (name == "sky") {
    return Environment::Create(PictureOfSky(Haze), name, options);
  }
  if (name == "studio") {
    return Environment::Create(PictureOfSky(Lamps), name, options);
  }
  if (name == "sun") {
    return Environment::Create(Sun(), name, options);
  }
  return absl::InvalidArgumentError(absl::StrCat("no generated environment \"", std::string(name),
                                                 "\", expected ",
                                                 absl::StrJoin(GeneratedEnvironmentNames(), ", ")));
}

}  // namespace tessera
