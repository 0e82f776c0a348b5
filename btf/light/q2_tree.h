// An environment as a few directional lights: the spherical quad-tree ("Q2-tree") of Wan et al.
//
// The sphere is cut into the 12 equal-area quads of HEALPix, each of them again and again into four. From the
// whole sphere down, the part that matters most is cut in two until there are as many parts as lights are
// asked for; each becomes one light with all of its part's radiance. Differs from the source, where every cut
// makes four quads: here a quad is cut in halves and a half into quads, and the 12 quads by longitude into 6,
// 3 and single ones, so that any number of lights can be had.
//
//   Q2Tree tree(environment);
//   TESSERA_ASSIGN_OR_RETURN(const std::vector<EnvironmentLight> lights, tree.Lights(200));
//   // each is a directional Light of render/preview.h, with that irradiance
//
// Sources: [Wan2005] for the tree; [Gorski2005] for the quads and their numbers, about +y here. Which part is
// cut next, and where a part's light comes from, is ours: the part with the largest power times spread, power
// being luminance times solid angle and spread the root mean square of sin from the power's mean direction,
// which is the light's. ([Agarwal2003], used by the source, has power times the fourth root of solid angle,
// and goes on cutting around a sun that already is alone.)
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/light/environment.h"

namespace tessera {

inline constexpr int kMaxQ2Lights = 4096;

struct EnvironmentLight {
  Eigen::Vector3d direction;  // towards the light, unit, in the world
  Eigen::Array3d irradiance;  // on a facing surface: the sum of its texels' radiance times solid angle
  double solid_angle = 0.0;   // of its texels, steradians
};

// The number of the HEALPix quad, nested scheme, in which `direction` lies, a unit vector of the picture:
// face (0 to 11) * 4^level + place within it, two bits a level. level in 0..15.
[[nodiscard]] int64_t HealpixQuad(const Eigen::Vector3d& direction, int level);

// Immutable. The quads go with the picture: a turned environment has the same lights, turned.
class Q2Tree {
 public:
  // Takes each texel as one point of light at its centre (texels of small pictures as several), so parts are
  // cut along texels. Time and memory: a look at each texel, and 60 bytes for each of up to 800,000 quads.
  // Thread-safe after.
  explicit Q2Tree(const Environment& environment);

  // Exactly `count` lights, or fewer where fewer of the smallest quads hold light; none of black. Their
  // irradiance adds up to environment.power() (to 1e-12 of it), and each has radiance times its solid angle
  // where radiance is constant. In order of falling luminance, ties by place. The same every time. Errors:
  // INVALID_ARGUMENT unless 1 <= count <= kMaxQ2Lights.
  [[nodiscard]] absl::StatusOr<std::vector<EnvironmentLight>> Lights(int count) const;

 private:
  // Sums over texels of one of the smallest quads, or of many.
  struct Sums {
    Eigen::Array3d irradiance = Eigen::Array3d::Zero();
    Eigen::Vector3d moment = Eigen::Vector3d::Zero();  // luminance times direction, in the picture
    double solid_angle = 0.0;

    Sums& operator+=(const Sums& other);
  };
  // A run of the smallest quads, in order.
  struct Part {
    int64_t first = 0;
    int64_t count = 0;
    Sums sums;
    double importance = 0.0;
  };

  [[nodiscard]] Sums SumOf(int64_t first, int64_t count) const;
  [[nodiscard]] Part MakePart(int64_t first, int64_t count) const;
  [[nodiscard]] int64_t FirstHalf(int64_t count) const;
  [[nodiscard]] EnvironmentLight LightOf(const Part& part) const;

  int level_ = 0;
  std::vector<Sums> quads_;  // by longitude, then as numbered
  Eigen::Matrix3d world_from_picture_;
};

}  // namespace tessera
