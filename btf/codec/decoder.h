// Decoding of BTFels to reflectance, independent of the codec. Part of the client SDK.
//
//   TESSERA_ASSIGN_OR_RETURN(auto decoder, MakeDecoder(material.btfels));
//   Eigen::Array3d rgb = decoder->Decode(material.btfels.btfel(i), light, view, /*turns=*/0);
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"

namespace tessera {

// Immutable and safe to share between threads. Keeps no reference to the codes, only to copies of the shared
// tables.
class Decoder {
 public:
  virtual ~Decoder() = default;

  // Linear in `coefficients` (dequantised, [k]) and so before the clamp at 0 that ends every decode: RGB
  // reflectance, possibly negative. light and view are unit vectors in the BTFel's own, unturned frame. Polar
  // angles beyond the largest measured one are clamped to it (for lights the value is then scaled by
  // cos(theta) / cos(theta_max)); 0 when either is at or below the horizon.
  [[nodiscard]] virtual Eigen::Array3d Evaluate(std::span<const double> coefficients,
                                                const Eigen::Vector3d& light,
                                                const Eigen::Vector3d& view) const = 0;

  [[nodiscard]] int num_coefficients() const { return static_cast<int>(offset_.size()); }
  // values[i] = offset[i] + step[i] * codes[i]; both spans have k elements.
  void Dequantize(std::span<const uint8_t> codes, std::span<double> values) const;

  // Reflectance >= 0 of one BTFel turned by `turns` quarter turns, light and view in the surface's frame.
  [[nodiscard]] Eigen::Array3d Decode(std::span<const uint8_t> codes, const Eigen::Vector3d& light,
                                      const Eigen::Vector3d& view, int turns) const;

 protected:
  explicit Decoder(const BtfelTable& table) : offset_(table.offset), step_(table.step) {}

 private:
  std::vector<float> offset_;
  std::vector<float> step_;
};

// The decoder of table.codec_id. Errors: UNIMPLEMENTED naming an unknown codec or version, INVALID_ARGUMENT
// naming a missing or misshapen table.
[[nodiscard]] absl::StatusOr<std::unique_ptr<Decoder>> MakeDecoder(const BtfelTable& table);

}  // namespace tessera
