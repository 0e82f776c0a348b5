// What a codec offers: encode, embedding, GLSL; decoding is in decoder.h, which the client SDK links without
// this.
//
//   const Codec* codec = FindCodec("dsh-cls");
//   TESSERA_ASSIGN_OR_RETURN(Material material, codec->Encode(source, {.kl = 25, .kv = 25}, context));
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/code_buffer.h"
#include "btf/codec/material.h"
#include "btf/data/btf_source.h"

namespace tessera {

// The energy bound of the constrained least squares: the integral of f^2 estimated as (solid angle / M) sum
// f^2.
enum class ClsEnergy { kHemisphere, kSphere };

// Coefficients a texel of "dfmf" where nothing else is asked.
inline constexpr int kDefaultDfmfRank = 48;

// Codecs ignore what is not theirs.
struct EncodeParams {
  int kl = 25;  // light coefficients, one of 1, 4, 9, 16, 25, 36, 49
  int kv = 25;  // view coefficients, likewise
  ClsEnergy cls_energy = ClsEnergy::kHemisphere;
  int eigen_textures = 5;  // of each view of "view-pca", 1 to 255
  // Of "dfmf", at most one of the three; none: rank kDefaultDfmfRank.
  int rank = 0;  // coefficients a texel, 0 for none; fewer where more would add nothing
  double max_error =
      0.0;  // RMSE of decoded linear RGB over all samples, absolute, 0 for none: smallest that meets it
  uint64_t max_bytes = 0;  // of the whole container, 0 for none: most accurate that fits
  uint64_t memory_budget_bytes = uint64_t{512} << 20;
  std::filesystem::path spill_folder;  // for what exceeds the budget; empty: the system's temporary folder
};

// Room for the codes of a result: in memory up to a quarter of the budget, in a spill file beyond it. Fill it
// block by block, each followed by DropPages(). Errors: RESOURCE_EXHAUSTED naming the bytes needed and free.
[[nodiscard]] inline absl::StatusOr<CodeBuffer> CreateCodes(uint64_t num_codes, const EncodeParams& params) {
  return CodeBuffer::Create(num_codes, params.memory_budget_bytes / 4, params.spill_folder);
}

// Texels as points in R^dims in which squared Euclidean distance approximates the hemisphere-integrated
// squared difference of two BTFels (mean over channels), each as seen after `turn` quarter turns. Components
// are in order of falling variance, so a prefix is a coarser embedding.
struct Embedding {
  int width = 0;
  int height = 0;
  int dims = 0;
  std::vector<float> values;     // [turn 0..3][height][width][dims]; (x, y) always in the unturned exemplar
  std::vector<double> variance;  // [dims], of each component
  double total_variance =
      0.0;  // of all components, kept or not; captured share = sum(variance) / total_variance

  [[nodiscard]] const float* at(int turn, int x, int y) const {
    return values.data() + ((static_cast<size_t>(turn) * height + y) * width + x) * dims;
  }
};

// GLSL of a codec. Declares
//   vec3 BlendBtfels(ivec4 btfels, ivec4 turns, vec4 weights, int count, Incidence light, vec3 view)
// the weighted sum of the first `count` BTFels' values, unclamped, each turned by its quarter turns, under
// one pair of directions in the surface's frame, with the semantics of Decoder::Evaluate; it reads the
// buffer textures below through texelFetch. `Incidence` is a macro, vec3 here.
struct CodecGlsl {
  std::string source;
  int words_per_btfel = 0;
  std::vector<uint32_t> btfel_words;  // usamplerBuffer `btfel_words`, format RGBA32UI, padded to whole texels
  std::vector<float> shared_values;   // samplerBuffer `codec_values`, format RGBA32F, padded likewise
  std::vector<uint32_t>
      shared_words;  // usamplerBuffer `codec_words`, format RGBA32UI; not declared when empty
};

// The same for light in the frequency domain: Incidence is vec3[n], light from all around as the sum of
// light[i] Y_i by directions of the surface's frame, and the sum has the semantics of Decoder::LightHarmonics
// (pi times the radiance). Reads the buffers of the table's CodecGlsl, and these.
struct HarmonicsGlsl {
  std::string source;
  std::vector<float> values;    // samplerBuffer `harmonics_values`, RGBA32F; not declared when empty
  std::vector<uint32_t> words;  // usamplerBuffer `harmonics_words`, RGBA32UI; not declared when empty
};

// A BTFel turned by quarter turns, counter-clockwise, has coefficients c'[i] = sign[i] * c[source[i]].
struct CoefficientTurn {
  std::vector<int> source;
  std::vector<float> sign;
};
using CoefficientTurns = std::array<CoefficientTurn, 4>;  // by turns; 0 is the identity

class Codec {
 public:
  virtual ~Codec() = default;
  [[nodiscard]] virtual std::string_view id() const = 0;
  [[nodiscard]] virtual int version() const = 0;

  // Encodes every texel; streams rows within params.memory_budget_bytes. The result is part of it
  // (CreateCodes). Errors: INVALID_ARGUMENT naming the parameter and its
  // legal values, or the sample that is not finite; RESOURCE_EXHAUSTED when the spill folder is full;
  // CANCELLED; whatever the source returns.
  [[nodiscard]] virtual absl::StatusOr<Material> Encode(BtfSource& source, const EncodeParams& params,
                                                        const RunContext& context) const = 0;

  // PCA embedding over the exemplar in all four turns, centred once over all.
  // Errors: INVALID_ARGUMENT (dims < 1), CANCELLED.
  [[nodiscard]] virtual absl::StatusOr<Embedding> Embed(const Material& material, int dims,
                                                        const RunContext& context) const = 0;

  // The BTFels of `more`, which share the codec's tables with `table`, are numbered on from those of `table`;
  // each may have a quantisation of its own, except with "view-pca". Errors: INVALID_ARGUMENT naming the
  // table or parameter that is missing or misshapen, or the one of `more` that does not go with `table`.
  [[nodiscard]] virtual absl::StatusOr<CodecGlsl> Glsl(const BtfelTable& table,
                                                       std::span<const BtfelTable* const> more) const = 0;

  // Beside Glsl() of the same tables; n is a legal count (math/spherical_harmonics.h). Errors: the same.
  [[nodiscard]] virtual absl::StatusOr<HarmonicsGlsl> GlslOfHarmonics(const BtfelTable& table,
                                                                      std::span<const BtfelTable* const> more,
                                                                      int n) const = 0;

  // What quarter turns do to coefficients; nothing where turning is no signed permutation of them.
  // Errors: INVALID_ARGUMENT naming the table or parameter that is missing or misshapen.
  [[nodiscard]] virtual absl::StatusOr<std::optional<CoefficientTurns>> Turns(
      const BtfelTable& /*table*/) const {
    return std::nullopt;
  }
};

// nullptr when unknown. Codecs are immutable and live for the whole program.
[[nodiscard]] const Codec* FindCodec(std::string_view id);
// Ids in order of registration, for messages and help.
[[nodiscard]] std::vector<std::string_view> CodecIds();

}  // namespace tessera
