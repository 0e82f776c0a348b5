#include "btf/measure/pair_errors.h"

#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include <absl/strings/str_cat.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/image/image.h"
#include "btf/metrics/ssim.h"

namespace tessera {
namespace {

// Pairs compared at once: the samples of a texel lie pair after pair, so that many share a line of memory.
constexpr int64_t kPairsPerTask = 16;

absl::Status CheckIndices(const char* what, const std::vector<int>& indices, size_t count) {
  for (const int index : indices) {
    if (index < 0 || index >= static_cast<int>(count)) {
      return absl::InvalidArgumentError(
          absl::StrCat("errors of ", what, " ", index, ": expected 0 to ", count - 1));
    }
  }
  return indices.empty() ? absl::InvalidArgumentError(absl::StrCat("errors of no ", what)) : absl::OkStatus();
}

// Adds those of one picture of a row.
void AddRow(const float* reference, const float* decoded, const float* coded_reference, const float* coded,
            int count, SquareSums& sums) {
  double errors = 0.0;
  double references = 0.0;
  double coded_errors = 0.0;
  for (int i = 0; i < count; ++i) {
    const double value = reference[i];
    const double error = decoded[i] - value;
    const double coded_error = static_cast<double>(coded[i]) - coded_reference[i];
    references += value * value;
    errors += error * error;
    coded_errors += coded_error * coded_error;
  }
  sums.Add({errors, references, coded_errors, count});
}

}  // namespace

void SquareSums::Add(const SquareSums& other) {
  errors += other.errors;
  references += other.references;
  coded_errors += other.coded_errors;
  num_samples += other.num_samples;
}

double SquareSums::rmse() const {
  return num_samples == 0 ? 0.0 : std::sqrt(errors / static_cast<double>(num_samples));
}

double SquareSums::reference_rms() const {
  return num_samples == 0 ? 0.0 : std::sqrt(references / static_cast<double>(num_samples));
}

double SquareSums::relative_rmse() const {
  return errors == 0.0 ? 0.0 : std::sqrt(errors / references);
}

double SquareSums::psnr_db() const {
  return coded_errors == 0.0 ? std::numeric_limits<double>::infinity()
                             : -10.0 * std::log10(coded_errors / static_cast<double>(num_samples));
}

SquareSums Total(const PairErrors& errors) {
  SquareSums total;
  for (const SquareSums& sums : errors.sums) {
    total.Add(sums);
  }
  return total;
}

absl::StatusOr<PairErrors> MeasurePairs(BtfSource& source, const RowPredictor& predict, const PairSet& pairs,
                                        int row_stride, const RunContext& context) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckIndices("view", pairs.views, info.views.size()));
  TESSERA_RETURN_IF_ERROR(CheckIndices("light", pairs.lights, info.lights.size()));
  if (row_stride < 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("errors of every ", row_stride, "th row: expected at least 1"));
  }
  PairErrors result{pairs, std::vector<SquareSums>(pairs.size())};
  const size_t num_lights = info.lights.size();
  const size_t num_images = info.views.size() * num_lights;
  const int row_samples = info.width * 3;
  std::vector<float> samples(source.SamplesPerRow());
  for (int y = 0; y < info.height; y += row_stride) {
    TESSERA_RETURN_IF_ERROR(source.ReadRows(y, 1, samples, context));
    ParallelFor(context, 0, static_cast<int64_t>(pairs.size()), kPairsPerTask,
                [&](int64_t begin, int64_t end) {
                  const int count = static_cast<int>(end - begin);
                  Image decoded(info.width, count, 3);
                  Image reference(info.width, count, 3);
                  std::array<size_t, kPairsPerTask> image_index{};
                  for (int i = 0; i < count; ++i) {
                    const int view = pairs.views[(begin + i) / pairs.lights.size()];
                    const int light = pairs.lights[(begin + i) % pairs.lights.size()];
                    image_index[i] = view * num_lights + light;
                    predict(y, view, light, std::span(decoded.at(0, i), row_samples));
                  }
                  for (int sample = 0; sample < row_samples; ++sample) {
                    const float* const images = samples.data() + sample * num_images;
                    for (int i = 0; i < count; ++i) {
                      reference.at(0, i)[sample] = images[image_index[i]];
                    }
                  }
                  const Image coded = SrgbCoded(decoded);
                  const Image coded_reference = SrgbCoded(reference);
                  for (int i = 0; i < count; ++i) {
                    AddRow(reference.at(0, i), decoded.at(0, i), coded_reference.at(0, i), coded.at(0, i),
                           row_samples, result.sums[begin + i]);
                  }
                });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  return result;
}

absl::StatusOr<PairErrors> MeasureMaterial(BtfSource& source, const Material& material, const PairSet& pairs,
                                           int row_stride, const RunContext& context) {
  const BtfInfo& info = source.info();
  if (material.width != info.width || material.height != info.height) {
    return absl::InvalidArgumentError(absl::StrCat("a material of ", material.width, "x", material.height,
                                                   " texels for a source of ", info.width, "x", info.height));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
  const size_t row_codes = static_cast<size_t>(info.width) * material.btfels.num_coefficients;
  return MeasurePairs(
      source,
      [&](int y, int view, int light, std::span<float> rgb) {
        decoder->DecodeTexels(std::span(material.btfels.codes).subspan(y * row_codes, row_codes),
                              VectorFromDirection(info.lights[light]), VectorFromDirection(info.views[view]),
                              /*turns=*/0, rgb);
      },
      pairs, row_stride, context);
}

}  // namespace tessera
