#include "btf/codec/decoder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <string_view>
#include <utility>

#ifdef __AVX2__
#include <immintrin.h>
#endif

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include "btf/base/status_macros.h"
#include "btf/codec/dfmf/dfmf_decoder.h"
#include "btf/codec/dsh/dsh_decoder.h"
#include "btf/codec/view_pca/view_pca_decoder.h"

namespace tessera {
namespace {

template <typename CodecDecoder>
absl::StatusOr<std::unique_ptr<Decoder>> Make(const BtfelTable& table) {
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<CodecDecoder> decoder, CodecDecoder::Create(table));
  return std::unique_ptr<Decoder>(std::move(decoder));
}

struct KnownCodec {
  std::string_view id;
  int version;
  absl::StatusOr<std::unique_ptr<Decoder>> (*make)(const BtfelTable& table);
};

constexpr std::array kKnownCodecs = {
    KnownCodec{"dsh-cls", 1, &Make<DshDecoder>},      KnownCodec{"dsh", 1, &Make<DshDecoder>},
    KnownCodec{"dsh-ls", 1, &Make<DshDecoder>},       KnownCodec{"dfmf", kDfmfVersion, &Make<DfmfDecoder>},
    KnownCodec{"view-pca", 1, &Make<ViewPcaDecoder>},
};

// In DecodeTexels: runs of fewer codes (two cache lines) are fetched so many texels ahead.
constexpr int kPrefetchedRun = 128;
constexpr size_t kPrefetchedTexels = 16;

constexpr int kLanes = 8;
using Lanes = Eigen::Array<float, kLanes, 1>;

Lanes LanesOf(const uint8_t* codes) {
#ifdef __AVX2__
  // Compilers turn the loop below into three times as many instructions.
  Lanes values;
  const __m128i bytes = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(codes));
  _mm256_storeu_ps(values.data(), _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes)));
  return values;
#else
  return Eigen::Map<const Eigen::Array<uint8_t, kLanes, 1>>(codes).cast<float>();
#endif
}

// Sum of w[i] * codes[i]; lanes of their own, so that it vectorises without reordering a sum.
float Dot(const float* w, const uint8_t* codes, int count) {
  std::array<Lanes, 4> sums = {Lanes::Zero(), Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
  const auto add = [&](int i, Lanes& sum) { sum += Eigen::Map<const Lanes>(w + i) * LanesOf(codes + i); };
  int i = 0;
  for (; i + 4 * kLanes <= count; i += 4 * kLanes) {
    add(i, sums[0]);
    add(i + kLanes, sums[1]);
    add(i + 2 * kLanes, sums[2]);
    add(i + 3 * kLanes, sums[3]);
  }
  for (; i + kLanes <= count; i += kLanes) {
    add(i, sums[0]);
  }
  float rest = 0.0F;
  for (; i < count; ++i) {
    rest += w[i] * static_cast<float>(codes[i]);
  }
  return ((sums[0] + sums[1]) + (sums[2] + sums[3])).sum() + rest;
}

}  // namespace

void Decoder::Dequantize(std::span<const uint8_t> codes, std::span<double> values) const {
  assert(codes.size() == offset_.size() && values.size() == offset_.size());
  for (size_t i = 0; i < offset_.size(); ++i) {
    values[i] = static_cast<double>(offset_[i]) + static_cast<double>(step_[i]) * codes[i];
  }
}

Eigen::Array3d Decoder::Evaluate(std::span<const double> coefficients, const Eigen::Vector3d& light,
                                 const Eigen::Vector3d& view) const {
  assert(std::cmp_equal(coefficients.size(), num_coefficients()));
  const LinearForm form = Form(light, view);
  Eigen::Array3d rgb = Eigen::Array3d::Zero();
  const double* weight = form.weights.data();
  for (const LinearForm::Run& run : form.runs) {
    for (int i = run.first; i < run.first + run.count; ++i) {
      rgb[run.channel] += *weight++ * coefficients[i];
    }
  }
  return rgb;
}

Eigen::Array3d Decoder::Decode(std::span<const uint8_t> codes, const Eigen::Vector3d& light,
                               const Eigen::Vector3d& view, int turns) const {
  assert(std::cmp_equal(codes.size(), num_coefficients()));
  const LinearForm form = Form(UnturnedFromTurned(light, turns), UnturnedFromTurned(view, turns));
  Eigen::Array3d rgb = Eigen::Array3d::Zero();
  const double* weight = form.weights.data();
  for (const LinearForm::Run& run : form.runs) {
    for (int i = run.first; i < run.first + run.count; ++i) {
      rgb[run.channel] +=
          *weight++ * (static_cast<double>(offset_[i]) + static_cast<double>(step_[i]) * codes[i]);
    }
  }
  return rgb.max(0.0);
}

void Decoder::DecodeTexels(std::span<const uint8_t> codes, const Eigen::Vector3d& light,
                           const Eigen::Vector3d& view, int turns, std::span<float> rgb) const {
  const size_t k = offset_.size();
  assert(codes.size() % k == 0 && rgb.size() == codes.size() / k * 3);
  const LinearForm form = Form(UnturnedFromTurned(light, turns), UnturnedFromTurned(view, turns));
  // On codes: weight * (offset + step * code) = constant + (weight * step) * code.
  std::vector<float> weights(form.weights.size());
  Eigen::Array3d constant = Eigen::Array3d::Zero();
  size_t w = 0;
  for (const LinearForm::Run& run : form.runs) {
    for (int i = run.first; i < run.first + run.count; ++i, ++w) {
      constant[run.channel] += form.weights[w] * offset_[i];
      weights[w] = static_cast<float>(form.weights[w] * step_[i]);
    }
  }
  const std::array<float, 3> start = {static_cast<float>(constant[0]), static_cast<float>(constant[1]),
                                      static_cast<float>(constant[2])};
  // Codecs that read little of a BTFel step through memory too wide for the processor to see ahead.
  std::vector<int> short_runs;
  for (const LinearForm::Run& run : form.runs) {
    if (run.count > 0 && run.count < kPrefetchedRun) {
      short_runs.insert(short_runs.end(), {run.first, run.first + run.count - 1});
    }
  }
  for (size_t texel = 0; texel * k < codes.size(); ++texel) {
    if ((texel + kPrefetchedTexels) * k < codes.size()) {
      for (const int code : short_runs) {
        __builtin_prefetch(codes.data() + (texel + kPrefetchedTexels) * k + code);
      }
    }
    std::array<float, 3> sum = start;
    const float* weight = weights.data();
    for (const LinearForm::Run& run : form.runs) {
      sum[run.channel] += Dot(weight, codes.data() + texel * k + run.first, run.count);
      weight += run.count;
    }
    for (int channel = 0; channel < 3; ++channel) {
      rgb[3 * texel + channel] = std::max(sum[channel], 0.0F);
    }
  }
}

absl::StatusOr<std::unique_ptr<Decoder>> MakeDecoder(const BtfelTable& table) {
  const auto* const known =
      std::ranges::find(kKnownCodecs, std::string_view(table.codec_id), &KnownCodec::id);
  if (known == kKnownCodecs.end()) {
    return absl::UnimplementedError(absl::StrCat(
        "codec '", table.codec_id, "' is not known here; known: ",
        absl::StrJoin(kKnownCodecs, ", ",
                      [](std::string* out, const KnownCodec& codec) { out->append(codec.id); })));
  }
  if (table.codec_version != known->version) {
    return absl::UnimplementedError(absl::StrCat("codec '", table.codec_id, "' version ", table.codec_version,
                                                 ", this library reads ", known->version));
  }
  return known->make(table);
}

}  // namespace tessera
