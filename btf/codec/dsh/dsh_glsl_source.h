// The shader text of dsh*, and where its tables lie. For dsh_glsl.cc alone.
#pragma once

#include <cmath>
#include <string>

#include <Eigen/Core>

#include "btf/codec/btfel_table.h"

namespace tessera {

inline constexpr int kDshCodesPerTexel = 8;  // 16 bits each, of RGBA32UI

enum class DshBasisForm {
  kPlain,    // the identity
  kByOrder,  // each function mixes those of its own order m up to its degree, those of -m alike
  kGeneral,
};
// `basis` is square, [size][size].
[[nodiscard]] DshBasisForm DshBasisFormOf(const CodecTable& basis, int size);

// Where things lie in `codec_values`, in texels of four floats: the cosines and sines of the largest polar
// angles; the scales of the light and of the view functions; then the bases that are not the identity.
struct DshGlslLayout {
  int kl = 0;
  int kv = 0;
  DshBasisForm light_form = DshBasisForm::kPlain;
  DshBasisForm view_form = DshBasisForm::kPlain;

  static constexpr int kLightScaleBegin = 1;
  [[nodiscard]] int view_scale_begin() const { return kLightScaleBegin + Texels(kl); }
  [[nodiscard]] int light_basis_begin() const { return view_scale_begin() + Texels(kv); }
  [[nodiscard]] int view_basis_begin() const { return light_basis_begin() + BasisTexels(light_form, kl); }
  [[nodiscard]] int num_texels() const { return view_basis_begin() + BasisTexels(view_form, kv); }
  // A row: the codes of one view function, channel by channel.
  [[nodiscard]] int row_codes() const { return 3 * kl; }
  // Of one row of a BTFel; each starts at a texel.
  [[nodiscard]] int btfel_row_texels() const {
    return (row_codes() + kDshCodesPerTexel - 1) / kDshCodesPerTexel;
  }
  [[nodiscard]] int btfel_words() const { return kv * btfel_row_texels() * 4; }
  // The place of a coefficient in a BTFel of a table.
  [[nodiscard]] int coefficient(int channel, int j, int i) const { return (channel * kv + j) * kl + i; }

 private:
  static int Texels(int floats) { return (floats + 3) / 4; }
  static int BasisTexels(DshBasisForm form, int size) {
    switch (form) {
      case DshBasisForm::kPlain:
        return 0;
      case DshBasisForm::kByOrder: {
        int entries = 0;
        for (int n = static_cast<int>(std::lround(std::sqrt(size))); n > 0; --n) {
          entries += n * (n + 1) / 2;
        }
        return Texels(entries);
      }
      case DshBasisForm::kGeneral:
        return size * Texels(size);
    }
    return 0;
  }
};

// BlendBtfels of codec.h under one light.
[[nodiscard]] std::string DshGlslSource(const DshGlslLayout& layout);
// The same under `n` harmonics of light, whose integrals with the light functions are `integrals` [kl][n]
// (DshDecoder::LightIntegrals).
[[nodiscard]] std::string DshHarmonicsGlslSource(const DshGlslLayout& layout,
                                                 const Eigen::MatrixXd& integrals);

}  // namespace tessera
