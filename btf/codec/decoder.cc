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

// In DecodeTexels: runs of at least so many codes that no other channel reads are summed one by one, the rest
// for all channels together, so that a code is converted once.
constexpr int kLongRun = 128;
// Codecs that read little of a BTFel step through memory too wide for the processor to see ahead: what they
// read is fetched so many texels ahead.
constexpr size_t kPrefetchedTexels = 16;

// Eight codes and their weights in each channel.
struct Block {
  int first = 0;
  std::array<Lanes, 3> weights = {Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
};

struct LongRun {
  LinearForm::Run run;
  std::vector<float> weights;
};

// A form on codes: rgb = constant + what the long runs and the blocks add.
struct CodeForm {
  std::array<float, 3> constant;
  std::vector<LongRun> long_runs;
  std::vector<Block> blocks;
  bool is_sparse = false;  // less than half of a BTFel is read
};

CodeForm MakeCodeForm(const LinearForm& form, std::span<const float> offset, std::span<const float> step) {
  const int k = static_cast<int>(offset.size());
  CodeForm result;
  Eigen::Array3d constant = Eigen::Array3d::Zero();
  std::vector<std::array<float, 3>> joint(k, {0.0F, 0.0F, 0.0F});
  std::vector<bool> is_joint(k, false);
  size_t used = 0;
  const double* weight = form.weights.data();
  for (const LinearForm::Run& run : form.runs) {
    const bool is_shared = std::ranges::any_of(form.runs, [&run](const LinearForm::Run& other) {
      return other.channel != run.channel && other.first == run.first;
    });
    const bool is_alone = k < kLanes || (run.count >= kLongRun && !is_shared);
    if (is_alone) {
      result.long_runs.push_back({run, std::vector<float>(run.count)});
      used += run.count;
    }
    for (int i = 0; i < run.count; ++i) {
      // weight * (offset + step * code) = constant + (weight * step) * code.
      const int code = run.first + i;
      const auto on_code = static_cast<float>(*weight * step[code]);
      constant[run.channel] += *weight++ * offset[code];
      if (is_alone) {
        result.long_runs.back().weights[i] = on_code;
      } else {
        joint[code][run.channel] += on_code;
        is_joint[code] = true;
      }
    }
  }
  for (int channel = 0; channel < 3; ++channel) {
    result.constant[channel] = static_cast<float>(constant[channel]);
  }
  for (int i = 0; i < k; ++i) {
    if (!is_joint[i]) {
      continue;
    }
    // The last block ends with the BTFel, and leaves out what the one before it has.
    Block& block = result.blocks.emplace_back();
    block.first = std::min(i, k - kLanes);
    for (int lane = i - block.first; lane < kLanes; ++lane) {
      for (int channel = 0; channel < 3; ++channel) {
        block.weights[channel][lane] = joint[block.first + lane][channel];
      }
    }
    i = block.first + kLanes - 1;
    used += kLanes;
  }
  result.is_sparse = 2 * used < static_cast<size_t>(k);
  return result;
}

void DecodeTexel(const CodeForm& form, const uint8_t* codes, float* rgb) {
  std::array<float, 3> sum = form.constant;
  for (const LongRun& part : form.long_runs) {
    sum[part.run.channel] += Dot(part.weights.data(), codes + part.run.first, part.run.count);
  }
  if (!form.blocks.empty()) {
    std::array<Lanes, 3> sums = {Lanes::Zero(), Lanes::Zero(), Lanes::Zero()};
    for (const Block& block : form.blocks) {
      const Lanes values = LanesOf(codes + block.first);
      for (int channel = 0; channel < 3; ++channel) {
        sums[channel] += block.weights[channel] * values;
      }
    }
    for (int channel = 0; channel < 3; ++channel) {
      sum[channel] += sums[channel].sum();
    }
  }
  for (int channel = 0; channel < 3; ++channel) {
    rgb[channel] = std::max(sum[channel], 0.0F);
  }
}

}  // namespace

Eigen::Array3d LinearForm::ValueOf(std::span<const double> coefficients) const {
  Eigen::Array3d rgb = Eigen::Array3d::Zero();
  const double* weight = weights.data();
  for (const Run& run : runs) {
    for (int i = run.first; i < run.first + run.count; ++i) {
      rgb[run.channel] += *weight++ * coefficients[i];
    }
  }
  return rgb;
}

void Decoder::Dequantize(std::span<const uint8_t> codes, std::span<double> values) const {
  assert(codes.size() == offset_.size() && values.size() == offset_.size());
  for (size_t i = 0; i < offset_.size(); ++i) {
    values[i] = static_cast<double>(offset_[i]) + static_cast<double>(step_[i]) * codes[i];
  }
}

Eigen::Array3d Decoder::Evaluate(std::span<const double> coefficients, const Eigen::Vector3d& light,
                                 const Eigen::Vector3d& view) const {
  assert(std::cmp_equal(coefficients.size(), num_coefficients()));
  return Form(light, view).ValueOf(coefficients);
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
  const CodeForm on_codes = MakeCodeForm(form, offset_, step_);
  for (size_t texel = 0; texel * k < codes.size(); ++texel) {
    if (on_codes.is_sparse && (texel + kPrefetchedTexels) * k < codes.size()) {
      const uint8_t* const ahead = codes.data() + (texel + kPrefetchedTexels) * k;
      for (const Block& block : on_codes.blocks) {
        __builtin_prefetch(ahead + block.first);
        __builtin_prefetch(ahead + block.first + kLanes - 1);
      }
    }
    DecodeTexel(on_codes, codes.data() + texel * k, rgb.data() + 3 * texel);
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
