// Light from all around, infinitely far away: a picture of radiance by direction (texel_grid.h says which
// texel looks where), turned about the vertical and scaled.
//
//   TESSERA_ASSIGN_OR_RETURN(Environment environment, ReadEnvironment("venice.hdr", {.rotation_rad = 0.5}));
//   Eigen::Array3d sky = environment.Radiance({0, 1, 0});
//
// As light, radiance is constant over each texel: integrals are sums over texels with their solid angles. As
// a background, it is interpolated between texel centres.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/image/image.h"
#include "btf/light/texel_grid.h"

namespace tessera {

inline constexpr int64_t kMaxEnvironmentTexels = int64_t{1} << 25;  // 8192 x 4096

struct EnvironmentOptions {
  // None: kEquirect where the picture is twice as wide as high, kAngular where it is square.
  std::optional<EnvironmentLayout> layout;
  // About +y, counter-clockwise seen from above: by pi / 2, what was at +z comes from +x.
  double rotation_rad = 0.0;
  double scale = 1.0;  // of radiance, > 0
};

// Immutable.
class Environment {
 public:
  // `image` has 1 or 3 channels, or 4, of which alpha is left out. Errors: INVALID_ARGUMENT naming `name` and
  // the size, the layout, the option or the first texel that is negative or not finite (radiance; texels
  // outside the angular map's rim may hold anything).
  [[nodiscard]] static absl::StatusOr<Environment> Create(const Image& image, std::string_view name,
                                                          const EnvironmentOptions& options);

  [[nodiscard]] const TexelGrid& grid() const { return grid_; }
  [[nodiscard]] double rotation_rad() const { return rotation_rad_; }
  [[nodiscard]] double scale() const { return scale_; }
  // Turns a direction of the picture (texel_grid.h) into the world's.
  [[nodiscard]] const Eigen::Matrix3d& world_from_picture() const { return world_from_picture_; }

  // Linear RGB, scaled; 0 outside the angular map's rim.
  [[nodiscard]] Eigen::Array3d TexelRadiance(int x, int y) const {
    const float* const rgb = image_.at(x, y);
    return scale_ * Eigen::Array3d(rgb[0], rgb[1], rgb[2]);
  }
  [[nodiscard]] Eigen::Vector3d TexelDirection(int x, int y) const {
    return world_from_picture_ * grid_.Direction(x, y);
  }

  // Bilinear between texel centres, across the seam and the poles of kEquirect, within the rim of kAngular.
  // `direction` is a unit vector of the world.
  [[nodiscard]] Eigen::Array3d Radiance(const Eigen::Vector3d& direction) const;

  // The integral of radiance over all directions, and its mean over them.
  [[nodiscard]] const Eigen::Array3d& power() const { return power_; }
  [[nodiscard]] Eigen::Array3d MeanRadiance() const;

 private:
  Environment(TexelGrid grid, Image image, const EnvironmentOptions& options);

  TexelGrid grid_;
  Image image_;  // three channels
  double rotation_rad_;
  double scale_;
  Eigen::Matrix3d world_from_picture_;
  Eigen::Array3d power_;
};

// As an equirectangular picture of 2 height x height texels, each the mean, by solid angle, of the texels
// whose centres lie in it; one that holds none takes what is interpolated at its centre. Power changes by
// what texels across edges make.
[[nodiscard]] Environment Reduced(const Environment& environment, int height);

// A Radiance (.hdr) or OpenEXR picture, or any other that image/image_io.h reads, told by its first bytes.
// Errors: those of ReadImage and Environment::Create; more than kMaxEnvironmentTexels are refused before they
// are read.
[[nodiscard]] absl::StatusOr<Environment> ReadEnvironment(const std::filesystem::path& path,
                                                          const EnvironmentOptions& options);
// The same from a file's bytes.
[[nodiscard]] absl::StatusOr<Environment> DecodeEnvironment(std::span<const std::byte> bytes,
                                                            std::string_view name,
                                                            const EnvironmentOptions& options);

}  // namespace tessera
