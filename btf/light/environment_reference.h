// The radiance of a BTFel under an environment by brute force: what the faster ways are measured against.
#pragma once

#include <span>

#include <Eigen/Core>

#include "btf/codec/decoder.h"
#include "btf/light/environment.h"

namespace tessera {

// kClamp: each value as decoded, at least 0. kKeep: without the clamp that ends every decode, as the
// frequency domain has it.
enum class NegativeValues { kClamp, kKeep };

// (1 / pi) times the sum over all texels of value times radiance times solid angle, in double: light at the
// texel's centre, no shadows. `coefficients` [k] are dequantised; `view` is a unit vector in the surface's
// frame, whose axes are the rows of `local_from_world`; the BTFel is turned by `turns` quarter turns. Cost: a
// decode for each texel above the horizon.
[[nodiscard]] Eigen::Array3d EnvironmentRadiance(const Environment& environment, const Decoder& decoder,
                                                 std::span<const double> coefficients,
                                                 const Eigen::Vector3d& view,
                                                 const Eigen::Matrix3d& local_from_world, int turns,
                                                 NegativeValues negative_values);

}  // namespace tessera
