#include "btf/codec/diagnosis.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"

namespace tessera {
namespace {

constexpr double kNegligible = 1e-3;  // of the root mean square
constexpr double kRinging = 1e-2;     // likewise

double LargestTheta(const std::vector<Direction>& directions) {
  double theta = 0.0;
  for (const Direction& d : directions) {
    theta = std::max(theta, std::min(d.theta_rad, kPi / 2.0));
  }
  return theta;
}

double LargestGap(const std::vector<Direction>& directions, double largest_theta_rad) {
  constexpr double kStepDeg = 3.0;
  Eigen::Matrix3Xd measured(3, directions.size());
  for (size_t i = 0; i < directions.size(); ++i) {
    measured.col(static_cast<Eigen::Index>(i)) = VectorFromDirection(directions[i]);
  }
  double smallest_cosine = 1.0;
  for (double theta_deg = 0.0; RadFromDeg(theta_deg) <= largest_theta_rad; theta_deg += kStepDeg) {
    for (double phi_deg = 0.0; phi_deg < 360.0; phi_deg += kStepDeg) {
      const Eigen::Vector3d v = VectorFromDirection({RadFromDeg(theta_deg), RadFromDeg(phi_deg)});
      smallest_cosine = std::min(smallest_cosine, (measured.transpose() * v).maxCoeff());
    }
  }
  return std::acos(std::clamp(smallest_cosine, -1.0, 1.0));
}

// The samples and codes of the texels that are looked at.
struct Probe {
  std::vector<float> samples;  // [texel][channel][view][light]
  std::vector<uint8_t> codes;  // [texel][k]
  size_t num_texels = 0;
};

absl::StatusOr<Probe> ReadProbe(BtfSource& source, const Material& material, const RunContext& context) {
  const BtfInfo& info = source.info();
  RunContext quiet = context;
  quiet.progress = nullptr;
  Probe probe;
  std::vector<float> row(source.SamplesPerRow());
  const size_t per_texel = row.size() / info.width;
  const size_t k = material.btfels.num_coefficients;
  const int columns = std::min(info.width, kDiagnosedTexels / 2);
  int previous = -1;
  for (const int y : {info.height / 4, info.height * 3 / 4}) {
    if (y == previous) {
      continue;
    }
    previous = y;
    TESSERA_RETURN_IF_ERROR(source.ReadRows(y, 1, row, quiet));
    for (int column = 0; column < columns; ++column) {
      const size_t x = (static_cast<size_t>(column) * info.width + info.width / 2) / columns;
      const auto samples = std::span(row).subspan(x * per_texel, per_texel);
      const auto codes = material.btfels.btfel(static_cast<size_t>(y) * info.width + x).first(k);
      probe.samples.insert(probe.samples.end(), samples.begin(), samples.end());
      probe.codes.insert(probe.codes.end(), codes.begin(), codes.end());
      ++probe.num_texels;
    }
  }
  return probe;
}

struct ImageFigures {
  double squared_error = 0.0;
  double quantisation_variance = 0.0;  // mean over channels
  size_t num_negative = 0;
};

void AddWarnings(const Material& material, Diagnosis& d) {
  const auto warn = [&d](std::string text) { d.warnings.push_back(std::move(text)); };
  const auto check_set = [&](const char* what, const char* key, size_t count, double gap_rad,
                             double theta_rad) {
    const auto parameter = material.btfels.parameters.find(key);
    if (parameter != material.btfels.parameters.end() && parameter->is_number_integer() &&
        parameter->get<int64_t>() > static_cast<int64_t>(count)) {
      warn(absl::StrFormat("%s = %d coefficients from %d %ss: fewer measurements than unknowns", key,
                           parameter->get<int64_t>(), count, what));
    }
    if (DegFromRad(gap_rad) > kDirectionGapLimitDeg) {
      warn(absl::StrFormat("a direction %.0f degrees from every measured %s is interpolated, limit %.0f",
                           DegFromRad(gap_rad), what, kDirectionGapLimitDeg));
    }
    if (DegFromRad(theta_rad) < kSmallestThetaLimitDeg) {
      warn(absl::StrFormat(
          "%ss are measured up to %.0f degrees (below %.0f): beyond, the values at %.0f degrees are used",
          what, DegFromRad(theta_rad), kSmallestThetaLimitDeg, DegFromRad(theta_rad)));
    }
  };
  check_set("view", "kv", material.btfels.views.size(), d.view_gap_rad, d.largest_view_theta_rad);
  check_set("light", "kl", material.btfels.lights.size(), d.light_gap_rad, d.largest_light_theta_rad);
  if (d.quantisation_noise > kQuantisationNoiseLimit * d.rms) {
    warn(absl::StrFormat("rounding to 8 bits adds noise of %.3g times the signal, limit %.2g",
                         d.quantisation_noise / d.rms, kQuantisationNoiseLimit));
  }
  if (d.rmse > kErrorLimit * d.rms) {
    warn(
        absl::StrFormat("the decoded error is %.2f of the signal, limit %.2f: take more coefficients or "
                        "another codec",
                        d.rmse / d.rms, kErrorLimit));
  }
  if (d.negative_share > kNegativeShareLimit) {
    warn(absl::StrFormat("%.0f%% of the decoded values ring below 0 and are clamped, limit %.0f%%",
                         100.0 * d.negative_share, 100.0 * kNegativeShareLimit));
  }
  if (d.saturated_share > kSaturatedShareLimit) {
    warn(absl::StrFormat("%.1f%% of the samples have the largest value, limit %.0f%%: highlights are clipped",
                         100.0 * d.saturated_share, 100.0 * kSaturatedShareLimit));
  }
  // Many such images are a highlight that the codec misses.
  const size_t num_images = material.btfels.views.size() * material.btfels.lights.size();
  if (d.worst_image_ratio > kWorstImageLimit &&
      d.num_like_worst <= std::max<size_t>(1, num_images / kImagesPerDamaged)) {
    warn(
        absl::StrFormat("view %d, light %d fits %.0f times worse than the median image, limit %.0f: is the "
                        "image damaged?",
                        d.worst_view, d.worst_light, d.worst_image_ratio, kWorstImageLimit));
  }
}

}  // namespace

absl::StatusOr<Diagnosis> DiagnoseMaterial(BtfSource& source, const Material& material,
                                           const RunContext& context) {
  const BtfInfo& info = source.info();
  const size_t num_views = info.views.size();
  const size_t num_lights = info.lights.size();
  if (material.width != info.width || material.height != info.height ||
      material.btfels.views.size() != num_views || material.btfels.lights.size() != num_lights) {
    return absl::InvalidArgumentError(
        absl::StrFormat("material of %dx%d texels, %d views, %d lights, source of %dx%d, %d, %d",
                        material.width, material.height, material.btfels.views.size(),
                        material.btfels.lights.size(), info.width, info.height, num_views, num_lights));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(material.btfels));
  TESSERA_ASSIGN_OR_RETURN(const Probe probe, ReadProbe(source, material, context));

  Diagnosis d;
  double sum_of_squares = 0.0;
  float smallest = probe.samples[0];
  float largest = probe.samples[0];
  for (const float v : probe.samples) {
    sum_of_squares += static_cast<double>(v) * v;
    smallest = std::min(smallest, v);
    largest = std::max(largest, v);
  }
  const auto num_samples = static_cast<double>(probe.samples.size());
  d.rms = std::sqrt(sum_of_squares / num_samples);
  if (smallest < largest) {
    d.saturated_share = static_cast<double>(std::ranges::count(probe.samples, largest)) / num_samples;
  }

  const size_t num_images = num_views * num_lights;
  const size_t k = material.btfels.num_coefficients;
  std::vector<ImageFigures> images(num_images);
  ParallelFor(context, 0, static_cast<int64_t>(num_images), 64, [&](int64_t begin, int64_t end) {
    for (int64_t image = begin; image < end; ++image) {
      const Eigen::Vector3d view = VectorFromDirection(info.views[image / num_lights]);
      const Eigen::Vector3d light = VectorFromDirection(info.lights[image % num_lights]);
      const LinearForm form = decoder->Form(light, view);
      ImageFigures& figures = images[image];
      constexpr double kVarianceOfRounding = 1.0 / 12.0;  // in steps squared
      size_t weight = 0;
      for (const LinearForm::Run& run : form.runs) {
        for (int i = run.first; i < run.first + run.count; ++i, ++weight) {
          const double step = form.weights[weight] * material.btfels.step[i];
          figures.quantisation_variance += step * step * kVarianceOfRounding / 3.0;
        }
      }
      for (size_t texel = 0; texel < probe.num_texels; ++texel) {
        Eigen::Array3d rgb = Eigen::Array3d::Zero();
        const uint8_t* codes = probe.codes.data() + texel * k;
        const double* w = form.weights.data();
        for (const LinearForm::Run& run : form.runs) {
          for (int i = run.first; i < run.first + run.count; ++i) {
            rgb[run.channel] += *w++ * (static_cast<double>(material.btfels.offset[i]) +
                                        static_cast<double>(material.btfels.step[i]) * codes[i]);
          }
        }
        for (size_t channel = 0; channel < 3; ++channel) {
          const double value = rgb[static_cast<Eigen::Index>(channel)];
          const double error =
              std::max(0.0, value) - probe.samples[(texel * 3 + channel) * num_images + image];
          figures.squared_error += error * error;
          figures.num_negative += value < -kRinging * d.rms ? 1 : 0;
        }
      }
    }
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());

  double squared_error = 0.0;
  double quantisation_variance = 0.0;
  size_t num_negative = 0;
  std::vector<double> by_image;
  for (const ImageFigures& image : images) {
    squared_error += image.squared_error;
    quantisation_variance += image.quantisation_variance;
    num_negative += image.num_negative;
    by_image.push_back(image.squared_error);
  }
  d.rmse = std::sqrt(squared_error / num_samples);
  d.quantisation_noise = std::sqrt(quantisation_variance / static_cast<double>(num_images));
  d.negative_share = static_cast<double>(num_negative) / num_samples;
  const size_t worst = static_cast<size_t>(std::ranges::max_element(by_image) - by_image.begin());
  const double worst_error = by_image[worst];
  d.num_like_worst = static_cast<size_t>(
      std::ranges::count_if(by_image, [&](double error) { return error > worst_error / 4.0; }));
  std::ranges::nth_element(by_image, by_image.begin() + static_cast<std::ptrdiff_t>(num_images / 2));
  const double median_error = by_image[num_images / 2];
  const double negligible = kNegligible * d.rms;
  d.worst_view = worst / num_lights;
  d.worst_light = worst % num_lights;
  const double least = negligible * negligible * 3.0 * static_cast<double>(probe.num_texels);
  if (worst_error > least) {
    d.worst_image_ratio = std::sqrt(worst_error / std::max(median_error, least));
  }
  d.largest_view_theta_rad = LargestTheta(info.views);
  d.largest_light_theta_rad = LargestTheta(info.lights);
  d.view_gap_rad = LargestGap(info.views, d.largest_view_theta_rad);
  d.light_gap_rad = LargestGap(info.lights, d.largest_light_theta_rad);
  AddWarnings(material, d);
  return d;
}

absl::Status RecordDiagnosis(BtfSource& source, const RunContext& context, Material& material) {
  TESSERA_ASSIGN_OR_RETURN(const Diagnosis d, DiagnoseMaterial(source, material, context));
  material.metadata["diagnosis"] = {
      {"rms", d.rms},
      {"rmse", d.rmse},
      {"quantisation_noise", d.quantisation_noise},
      {"negative_share", d.negative_share},
      {"saturated_share", d.saturated_share},
      {"worst_image", {{"view", d.worst_view}, {"light", d.worst_light}, {"ratio", d.worst_image_ratio}}},
      {"view_gap_deg", DegFromRad(d.view_gap_rad)},
      {"light_gap_deg", DegFromRad(d.light_gap_rad)},
      {"largest_view_theta_deg", DegFromRad(d.largest_view_theta_rad)},
      {"largest_light_theta_deg", DegFromRad(d.largest_light_theta_rad)},
      {"warnings", d.warnings}};
  return absl::OkStatus();
}

}  // namespace tessera
