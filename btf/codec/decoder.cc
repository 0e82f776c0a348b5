#include "btf/codec/decoder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>
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
using Lanes = float __attribute__((vector_size(kLanes * sizeof(float))));

Lanes LanesOf(const uint8_t* codes) {
#ifdef __AVX2__
  // Compilers turn what is below into three times as many instructions.
  return _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(codes))));
#else
  uint8_t __attribute__((vector_size(kLanes))) bytes;
  std::memcpy(&bytes, codes, kLanes);
  return __builtin_convertvector(bytes, Lanes);
#endif
}

// A colour; the last element is of no account.
using Rgb = float __attribute__((vector_size(4 * sizeof(float))));

// The sum of the lanes, for each channel.
Rgb SumsOf(const std::array<Lanes, 3>& lanes) {
#ifdef __AVX2__
  const __m256 pairs = _mm256_hadd_ps(_mm256_hadd_ps(lanes[0], lanes[1]), _mm256_hadd_ps(lanes[2], lanes[2]));
  return _mm256_castps256_ps128(pairs) + _mm256_extractf128_ps(pairs, 1);
#else
  Rgb sums{};
  for (size_t channel = 0; channel < 3; ++channel) {
    const Lanes& x = lanes[channel];
    sums[channel] = ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
  }
  return sums;
#endif
}

// Eight codes and their weights in `kChannels` channels.
template <size_t kChannels>
struct Block {
  int first = 0;
  std::array<Lanes, kChannels> weights{};
};

// A form on codes, for each channel: rgb = constant + what the blocks add.
struct CodeForm {
  Rgb constant{};
  std::array<std::vector<Block<1>>, 3> blocks;  // of codes that no other channel reads
  std::vector<Block<3>> shared_blocks;
  std::vector<int> lines;  // codes of a large BTFel, one for each line of memory that is read
};

// How many texels are summed together: each weight is loaded once for all of them, and their sums just fit
// the processor's registers.
constexpr size_t kTexelsTogether = 4;
// The processor does not see ahead where little of a large BTFel is read, nor where four of them are read at
// once: what is read is fetched so many texels ahead. Small ones it fetches better by itself.
constexpr size_t kPrefetchedTexels = 8;
constexpr int kLargeBtfelBytes = 256;

// Codes that have readers, one for each line of memory that they may lie in.
std::vector<int> LinesOf(std::span<const unsigned> readers) {
  constexpr int kLineBytes = 64;
  std::vector<int> lines;
  for (int i = 0; std::cmp_less(i, readers.size()); ++i) {
    // A BTFel may start anywhere in a line: the last code of several may lie in one more.
    const bool is_last = std::cmp_equal(i + 1, readers.size()) || readers[i + 1] == 0;
    if (readers[i] != 0 && (lines.empty() || is_last || i >= lines.back() + kLineBytes)) {
      lines.push_back(i);
    }
  }
  return lines;
}

CodeForm MakeCodeForm(const LinearForm& form, std::span<const float> offset, std::span<const float> step) {
  const int k = static_cast<int>(offset.size());
  CodeForm result;
  Eigen::Array3d constant = Eigen::Array3d::Zero();
  std::vector<std::array<float, 3>> weights(k, {0.0F, 0.0F, 0.0F});
  std::vector<unsigned> readers(k, 0);  // a bit for each channel
  const double* weight = form.weights.data();
  for (const LinearForm::Run& run : form.runs) {
    for (int i = run.first; i < run.first + run.count; ++i) {
      // weight * (offset + step * code) = constant + (weight * step) * code.
      constant[run.channel] += *weight * offset[i];
      weights[i][run.channel] += static_cast<float>(*weight++ * step[i]);
      readers[i] |= 1U << run.channel;
    }
  }
  for (int channel = 0; channel < 3; ++channel) {
    result.constant[channel] = static_cast<float>(constant[channel]);
  }
  // Cuts the codes with the given readers into blocks; fill(block, lane, code) sets the weights.
  const auto cut = [&](const auto& has_readers, auto& blocks, const auto& fill) {
    for (int i = 0; i < k; ++i) {
      if (has_readers(readers[i])) {
        auto& block = blocks.emplace_back();
        // The last block ends with the BTFel, and leaves out what the one before it has.
        block.first = std::min(i, std::max(0, k - kLanes));
        const int end = std::min(block.first + kLanes, k);
        for (; i < end; ++i) {
          if (has_readers(readers[i])) {
            fill(block, i - block.first, i);
          }
        }
        --i;
      }
    }
  };
  for (unsigned channel = 0; channel < 3; ++channel) {
    cut([&](unsigned bits) { return bits == 1U << channel; }, result.blocks[channel],
        [&](Block<1>& block, int lane, int code) { block.weights[0][lane] = weights[code][channel]; });
  }
  cut([](unsigned bits) { return std::popcount(bits) > 1; }, result.shared_blocks,
      [&](Block<3>& block, int lane, int code) {
        for (int channel = 0; channel < 3; ++channel) {
          block.weights[channel][lane] = weights[code][channel];
        }
      });
  if (k >= kLargeBtfelBytes) {
    result.lines = LinesOf(readers);
  }
  return result;
}

// body(0), body(1) .. as constants, so that what they index stays in registers.
template <size_t kCount, typename Body>
void Unrolled(const Body& body) {
  [&]<size_t... kIndices>(std::index_sequence<kIndices...>) {
    (body(std::integral_constant<size_t, kIndices>()), ...);
  }
  (std::make_index_sequence<kCount>());
}

// `kTexels` BTFels, k codes apart; kLanes codes of each must be there.
template <size_t kTexels>
[[gnu::flatten, gnu::noinline]] void DecodeTogether(const CodeForm& form, const uint8_t* codes, size_t k,
                                                    float* rgb) {
  std::array<std::array<Lanes, 3>, kTexels> sums{};
  for (const Block<3>& block : form.shared_blocks) {
    Unrolled<kTexels>([&](auto t) {
      const Lanes values = LanesOf(codes + t * k + block.first);
      Unrolled<3>([&](auto channel) { sums[t][channel] += block.weights[channel] * values; });
    });
  }
  Unrolled<3>([&](auto channel) {
    for (const Block<1>& block : form.blocks[channel]) {
      Unrolled<kTexels>(
          [&](auto t) { sums[t][channel] += block.weights[0] * LanesOf(codes + t * k + block.first); });
    }
  });
  Unrolled<kTexels>([&](auto t) {
    const Rgb sum = form.constant + SumsOf(sums[t]);
    const Rgb colour = sum > 0.0F ? sum : Rgb{};
    std::memcpy(rgb + 3 * t, &colour, 3 * sizeof(float));
  });
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
  const size_t num_texels = codes.size() / k;
  // A smaller BTFel is read with the first codes of the next, which weigh nothing.
  const size_t num_readable =
      codes.size() < kLanes ? 0 : std::min(num_texels, (codes.size() - kLanes) / k + 1);
  size_t texel = 0;
  for (; texel + kTexelsTogether <= num_readable; texel += kTexelsTogether) {
    if (texel + kTexelsTogether + kPrefetchedTexels <= num_texels) {
      for (size_t t = 0; t < kTexelsTogether; ++t) {
        const uint8_t* const ahead = codes.data() + (texel + t + kPrefetchedTexels) * k;
        for (const int code : on_codes.lines) {
          __builtin_prefetch(ahead + code);
        }
      }
    }
    DecodeTogether<kTexelsTogether>(on_codes, codes.data() + texel * k, k, rgb.data() + 3 * texel);
  }
  for (; texel < num_readable; ++texel) {
    DecodeTogether<1>(on_codes, codes.data() + texel * k, k, rgb.data() + 3 * texel);
  }
  for (; texel < num_texels; ++texel) {
    std::array<uint8_t, kLanes> padded{};
    std::ranges::copy(codes.subspan(texel * k, k), padded.begin());
    DecodeTogether<1>(on_codes, padded.data(), k, rgb.data() + 3 * texel);
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
