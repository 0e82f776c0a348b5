#include "btf/codec/dsh/dsh_glsl.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/coefficient_range.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/codec/dsh/dsh_glsl_source.h"

namespace tessera {
namespace {

constexpr int kMaxBasis = 49;     // l <= 6
constexpr int kMostCode = 32766;  // a rounding below what 16 bits hold
// Coefficients that never exceed this share of the largest one are stored as coarsely as if they did.
constexpr double kLeastShare = 1e-6;

// kl or kv from the shape of a basis table.
absl::StatusOr<int> BasisSize(const BtfelTable& table, const std::string& name) {
  const auto found = table.tables.find(name);
  if (found == table.tables.end()) {
    return absl::InvalidArgumentError(absl::StrCat("codec table ", name, " is missing"));
  }
  const CodecTable& basis = found->second;
  const int64_t size = basis.shape.size() == 2 ? basis.shape[0] : 0;
  const int order = static_cast<int>(std::lround(std::sqrt(static_cast<double>(size))));
  if (size < 1 || size > kMaxBasis || int64_t{order} * order != size || basis.shape[1] != size ||
      static_cast<int64_t>(basis.values.size()) != size * size) {
    return absl::InvalidArgumentError(
        absl::StrCat("codec table ", name, ": expected a square of 1, 4, 9, 16, 25, 36 or 49 rows, got ",
                     size, " rows and ", basis.values.size(), " values"));
  }
  return static_cast<int>(size);
}

absl::StatusOr<double> LargestPolarAngle(const std::vector<Direction>& directions, const char* what) {
  double largest = 0.0;
  for (const Direction& direction : directions) {
    largest = std::max(largest, direction.theta_rad);
  }
  if (directions.empty() || !std::isfinite(largest)) {
    return absl::InvalidArgumentError(absl::StrCat("the table's ", what, " are missing or not finite"));
  }
  return largest;
}

// Factors a_i and b_j, the products of which are at least `least`[i * kv + j] > 0 and not much above: a_i
// starts as the root of a sum of squares, then each is made as low as the other allows.
void CoverByProducts(const std::vector<double>& least, int kl, int kv, std::span<float> a,
                     std::span<float> b) {
  std::vector<double> over_j(kl, 0.0);
  std::vector<double> over_i(kv, 0.0);
  for (int i = 0; i < kl; ++i) {
    for (int j = 0; j < kv; ++j) {
      over_j[i] += least[i * kv + j] * least[i * kv + j];
    }
    over_j[i] = std::sqrt(over_j[i]);
    for (int j = 0; j < kv; ++j) {
      over_i[j] = std::max(over_i[j], least[i * kv + j] / over_j[i]);
    }
  }
  for (int i = 0; i < kl; ++i) {
    double lowest = 0.0;
    for (int j = 0; j < kv; ++j) {
      lowest = std::max(lowest, least[i * kv + j] / over_i[j]);
    }
    a[i] = static_cast<float>(lowest);
  }
  std::ranges::transform(over_i, b.begin(), [](double factor) { return static_cast<float>(factor); });
}

void CopyBasis(const CodecTable& basis, int size, DshBasisForm form, int first_texel,
               std::vector<float>* values) {
  float* out = values->data() + 4 * static_cast<ptrdiff_t>(first_texel);
  if (form == DshBasisForm::kGeneral) {
    for (int i = 0; i < size; ++i, out += (size + 3) / 4 * 4) {
      std::copy_n(basis.values.begin() + static_cast<ptrdiff_t>(i) * size, size, out);
    }
  } else if (form == DshBasisForm::kByOrder) {
    // Triangles by order m, rows by degree, as AppendHarmonics reads them.
    const int orders = static_cast<int>(std::lround(std::sqrt(size)));
    for (int m = 0; m < orders; ++m) {
      for (int l = m; l < orders; ++l) {
        for (int below = m; below <= l; ++below) {
          *out++ = basis.values[(l * (l + 1) + m) * size + below * (below + 1) + m];
        }
      }
    }
  }
}

// The table's BTFels as multiples of the products of scales; `words` has room for them. Where they end.
uint32_t* PackBtfels(const BtfelTable& table, const DshGlslLayout& layout, std::span<const float> light_scale,
                     std::span<const float> view_scale, uint32_t* words) {
  const size_t k = table.num_coefficients;
  std::vector<float> step(k);
  std::vector<float> offset(k);  // and what makes the conversion to int round down, then to the nearest
  for (int channel = 0; channel < 3; ++channel) {
    for (int j = 0; j < layout.kv; ++j) {
      for (int i = 0; i < layout.kl; ++i) {
        const int n = layout.coefficient(channel, j, i);
        const double scale = static_cast<double>(light_scale[i]) * view_scale[j];
        step[n] = static_cast<float>(table.step[n] / scale);
        offset[n] = static_cast<float>(table.offset[n] / scale + kMostCode + 0.5);
      }
    }
  }
  // Code n of a row is bits 16 (n % 2) and on of word n / 2: on the little-endian machines that this is for,
  // 16-bit numbers in order.
  static_assert(std::endian::native == std::endian::little);
  const int row_words = layout.btfel_row_texels() * 4;
  auto* row = reinterpret_cast<int16_t*>(words);
  for (size_t btfel = 0; btfel < table.size(); ++btfel) {
    const uint8_t* const codes = table.codes.data() + btfel * k;
    for (int j = 0; j < layout.kv; ++j, row += 2 * static_cast<ptrdiff_t>(row_words)) {
      for (int channel = 0; channel < 3; ++channel) {
        const int first = layout.coefficient(channel, j, 0);
        for (int i = 0; i < layout.kl; ++i) {
          const float code = offset[first + i] + step[first + i] * static_cast<float>(codes[first + i]);
          row[channel * layout.kl + i] = static_cast<int16_t>(static_cast<int>(code) - kMostCode);
        }
      }
    }
  }
  return words + table.size() * layout.btfel_words();
}

absl::StatusOr<DshGlslLayout> LayoutOf(const BtfelTable& table) {
  DshGlslLayout layout;
  TESSERA_ASSIGN_OR_RETURN(layout.kl, BasisSize(table, "basis_light"));
  TESSERA_ASSIGN_OR_RETURN(layout.kv, BasisSize(table, "basis_view"));
  layout.light_form = DshBasisFormOf(table.tables.at("basis_light"), layout.kl);
  layout.view_form = DshBasisFormOf(table.tables.at("basis_view"), layout.kv);
  return layout;
}

}  // namespace

absl::StatusOr<CodecGlsl> DshGlsl(const BtfelTable& table, std::span<const BtfelTable* const> more) {
  TESSERA_ASSIGN_OR_RETURN(const DshGlslLayout layout, LayoutOf(table));
  TESSERA_ASSIGN_OR_RETURN(const double light_theta, LargestPolarAngle(table.lights, "lights"));
  TESSERA_ASSIGN_OR_RETURN(const double view_theta, LargestPolarAngle(table.views, "views"));
  const size_t k = static_cast<size_t>(3) * layout.kl * layout.kv;
  if (table.num_coefficients != static_cast<int>(k) || table.offset.size() != k || table.step.size() != k ||
      table.codes.size() % k != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("a table of kl = ", layout.kl, ", kv = ", layout.kv, " has ", k, " coefficients, got ",
                     table.num_coefficients, " with ", table.offset.size(), " offsets, ", table.step.size(),
                     " steps and ", table.codes.size(), " codes"));
  }
  TESSERA_RETURN_IF_ERROR(CheckSameCoefficients(table, more));
  const CodecTable& basis_light = table.tables.at("basis_light");
  const CodecTable& basis_view = table.tables.at("basis_view");

  CodecGlsl glsl;
  glsl.source = DshGlslSource(layout);
  glsl.shared_values.resize(static_cast<size_t>(layout.num_texels()) * 4);
  glsl.shared_values[0] = static_cast<float>(std::cos(light_theta));
  glsl.shared_values[1] = static_cast<float>(std::sin(light_theta));
  glsl.shared_values[2] = static_cast<float>(std::cos(view_theta));
  glsl.shared_values[3] = static_cast<float>(std::sin(view_theta));

  // The scales: no coefficient's value exceeds the largest code times those of its functions.
  const std::vector<double> magnitudes = LargestMagnitudes(table, more);
  std::vector<double> largest(static_cast<size_t>(layout.kl) * layout.kv, 0.0);
  for (int i = 0; i < layout.kl; ++i) {
    for (int j = 0; j < layout.kv; ++j) {
      for (int channel = 0; channel < 3; ++channel) {
        largest[i * layout.kv + j] =
            std::max(largest[i * layout.kv + j], magnitudes[layout.coefficient(channel, j, i)]);
      }
    }
  }
  const double most = *std::ranges::max_element(largest);
  for (double& value : largest) {
    value = most > 0.0 ? std::max(value, kLeastShare * most) / kMostCode : 1.0;
  }
  const std::span<float> values(glsl.shared_values);
  const std::span<float> light_scale = values.subspan(4 * DshGlslLayout::kLightScaleBegin, layout.kl);
  const std::span<float> view_scale = values.subspan(4 * layout.view_scale_begin(), layout.kv);
  CoverByProducts(largest, layout.kl, layout.kv, light_scale, view_scale);
  CopyBasis(basis_light, layout.kl, layout.light_form, layout.light_basis_begin(), &glsl.shared_values);
  CopyBasis(basis_view, layout.kv, layout.view_form, layout.view_basis_begin(), &glsl.shared_values);

  glsl.words_per_btfel = layout.btfel_words();
  glsl.btfel_words.resize(TotalSize(table, more) * glsl.words_per_btfel);
  uint32_t* words = PackBtfels(table, layout, light_scale, view_scale, glsl.btfel_words.data());
  for (const BtfelTable* const other : more) {
    words = PackBtfels(*other, layout, light_scale, view_scale, words);
  }
  return glsl;
}

absl::StatusOr<HarmonicsGlsl> DshHarmonicsGlsl(const BtfelTable& table, int n) {
  TESSERA_ASSIGN_OR_RETURN(const DshGlslLayout layout, LayoutOf(table));
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<DshDecoder> decoder, DshDecoder::Create(table));
  return HarmonicsGlsl{.source = DshHarmonicsGlslSource(layout, decoder->LightIntegrals().leftCols(n))};
}

}  // namespace tessera
