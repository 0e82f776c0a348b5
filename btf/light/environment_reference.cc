#include "btf/light/environment_reference.h"

#include "btf/math/conventions.h"

namespace tessera {

Eigen::Array3d EnvironmentRadiance(const Environment& environment, const Decoder& decoder,
                                   std::span<const double> coefficients, const Eigen::Vector3d& view,
                                   const Eigen::Matrix3d& local_from_world, int turns,
                                   NegativeValues negative_values) {
  const TexelGrid& grid = environment.grid();
  const Eigen::Vector3d eye = UnturnedFromTurned(view, turns);
  const Eigen::Matrix3d local_from_picture = local_from_world * environment.world_from_picture();
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  for (int y = 0; y < grid.height(); ++y) {
    Eigen::Array3d row = Eigen::Array3d::Zero();
    for (int x = 0; x < grid.width(); ++x) {
      const Eigen::Vector3d light = UnturnedFromTurned(local_from_picture * grid.Direction(x, y), turns);
      const double solid_angle = grid.SolidAngle(x, y);
      if (light.z() <= 0.0 || solid_angle == 0.0) {
        continue;
      }
      Eigen::Array3d value = decoder.Evaluate(coefficients, light, eye);
      if (negative_values == NegativeValues::kClamp) {
        value = value.max(0.0);
      }
      row += value * environment.TexelRadiance(x, y) * solid_angle;
    }
    sum += row;
  }
  return sum / kPi;
}

}  // namespace tessera
