// Decoding of BTFels to reflectance, independent of the codec. Part of the client SDK.
//
//   TESSERA_ASSIGN_OR_RETURN(auto decoder, MakeDecoder(material.btfels));
//   Eigen::Array3d rgb = decoder->Decode(material.btfels.btfel(i), light, view, /*turns=*/0);
//   decoder->DecodeTexels(material.btfels.codes, light, view, /*turns=*/0, picture);  // all of them at once
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/btfel_table.h"

namespace tessera {

// The values of all BTFels under one light and view, before the clamp at 0, as a linear function of their
// coefficients: rgb[run.channel] += sum over i < run.count of weight[i] * coefficient[run.first + i], summed
// over all runs, whose weights stand one run after another. Coefficients in no run do not matter.
struct LinearForm {
  struct Run {
    int channel = 0;
    int first = 0;
    int count = 0;
  };
  std::vector<Run> runs;
  std::vector<double> weights;

  // The value for `coefficients` [k].
  [[nodiscard]] Eigen::Array3d ValueOf(std::span<const double> coefficients) const;
};

// Immutable and safe to share between threads. Keeps no reference to the codes, only to copies of the shared
// tables.
class Decoder {
 public:
  virtual ~Decoder() = default;

  // light and view are unit vectors in the BTFel's own, unturned frame. Polar angles beyond the largest
  // measured one are clamped to it (for lights the value is then scaled by cos(theta) / cos(theta_max)); no
  // runs when either is at or below the horizon.
  [[nodiscard]] virtual LinearForm Form(const Eigen::Vector3d& light, const Eigen::Vector3d& view) const = 0;

  // The light side of BTFels in spherical harmonics, for light in the frequency domain: element i < n is the
  // integral over all directions of light of Y_i(light) times the value under that light and `view`, before
  // the clamp at 0, again as a linear function of the coefficients. All elements have the same runs; none at
  // all where the view is at or below the horizon. With an environment sum of L_i Y_i in the BTFel's own
  // frame, the sum over i of L_i times the values of element i is pi times the radiance, and exact for it.
  // `view` is as in Form(); n is a legal count (math/spherical_harmonics.h). The first call integrates over
  // the lights (light_harmonics.h), tens of milliseconds.
  [[nodiscard]] virtual std::vector<LinearForm> LightHarmonics(int n, const Eigen::Vector3d& view) const = 0;

  [[nodiscard]] int num_coefficients() const { return static_cast<int>(offset_.size()); }
  // values[i] = offset[i] + step[i] * codes[i]; both spans have k elements.
  void Dequantize(std::span<const uint8_t> codes, std::span<double> values) const;

  // RGB reflectance before the clamp at 0 that ends every decode, possibly negative, of dequantised
  // coefficients [k]; directions as in Form().
  [[nodiscard]] Eigen::Array3d Evaluate(std::span<const double> coefficients, const Eigen::Vector3d& light,
                                        const Eigen::Vector3d& view) const;

  // Reflectance >= 0 of one BTFel turned by `turns` quarter turns, light and view in the surface's frame.
  [[nodiscard]] Eigen::Array3d Decode(std::span<const uint8_t> codes, const Eigen::Vector3d& light,
                                      const Eigen::Vector3d& view, int turns) const;

  // The same of many BTFels, codes [n][k], in single precision on the calling thread: rgb is [n][3].
  void DecodeTexels(std::span<const uint8_t> codes, const Eigen::Vector3d& light, const Eigen::Vector3d& view,
                    int turns, std::span<float> rgb) const;

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
