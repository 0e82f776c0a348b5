#include "btf/wang/tile_set_layers.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>
#include <utility>

#include <absl/strings/str_cat.h>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace

std::vector<BlockFrequency> BlockFrequencies(int block_side) {
  std::vector<BlockFrequency> frequencies;
  for (int v = 0; v < block_side; ++v) {
    for (int u = 0; u < block_side; ++u) {
      frequencies.push_back({u, v});
    }
  }
  std::ranges::stable_sort(frequencies, [](const BlockFrequency& a, const BlockFrequency& b) {
    return std::tuple(a.u + a.v, a.v) < std::tuple(b.u + b.v, b.v);
  });
  return frequencies;
}

std::vector<float> LayerBlocks::StepFactors() const {
  // Of the mean of BTFels side by side, `pixels` of the exemplar wide.
  const auto mean = [&](int half_periods, double pixels) {
    const double angle = kPi * half_periods / (2.0 * side);
    const double single = std::sin(angle * footprint);
    return half_periods == 0 || single == 0.0
               ? 1.0
               : std::abs(std::sin(angle * pixels) * footprint / (pixels * single));
  };
  const auto level_pixels = static_cast<double>(uint64_t{1} << level);
  std::vector<float> factors;
  for (const auto& [u, v] : BlockFrequencies(side)) {
    const double seen = 0.5 * (mean(u, level_pixels) * mean(v, level_pixels) +
                               mean(u, 2.0 * level_pixels) * mean(v, 2.0 * level_pixels));
    factors.push_back(static_cast<float>(footprint / std::clamp(seen, kLeastSeen, 1.0)));
  }
  return factors;
}

LayerBlocks BlocksOf(std::span<const uint32_t> pixels, const SourceGrid& grid, int side, int level) {
  LayerBlocks blocks{.side = side, .footprint = grid.footprint, .level = level};
  const auto width = static_cast<uint32_t>(grid.width);
  const auto s = static_cast<uint32_t>(side);
  const uint32_t across = (width + s - 1) / s;
  const auto number = [&](uint32_t pixel) { return pixel / width / s * across + pixel % width / s; };
  std::ranges::transform(pixels, std::back_inserter(blocks.numbers), number);
  std::ranges::sort(blocks.numbers);
  blocks.numbers.erase(std::ranges::unique(blocks.numbers).begin(), blocks.numbers.end());
  for (const uint32_t pixel : pixels) {
    const auto block = static_cast<uint32_t>(std::ranges::lower_bound(blocks.numbers, number(pixel)) -
                                             blocks.numbers.begin());
    blocks.places.push_back((block * s + pixel / width % s) * s + pixel % width % s);
  }
  return blocks;
}

BlockCosines::BlockCosines(int block_side) : side_(block_side), frequencies_(BlockFrequencies(block_side)) {
  for (int u = 0; u < block_side; ++u) {
    const double norm = std::sqrt((u == 0 ? 1.0 : 2.0) / block_side);
    for (int x = 0; x < block_side; ++x) {
      matrix_.push_back(static_cast<float>(norm * std::cos(kPi * (2 * x + 1) * u / (2 * block_side))));
    }
  }
}

std::vector<float> BlockCosines::Forward(std::span<const float> image) const {
  std::vector<float> cosines(image.begin(), image.end());
  if (frequencies_.size() == 1) {
    return cosines;
  }
  const Eigen::Map<const Rows> matrix(matrix_.data(), side_, side_);
  const size_t num_blocks = image.size() / frequencies_.size();
  for (size_t block = 0; block < num_blocks; ++block) {
    const Eigen::Map<const Rows> from(image.data() + block * frequencies_.size(), side_, side_);
    const Rows transformed = matrix * from * matrix.transpose();
    for (size_t f = 0; f < frequencies_.size(); ++f) {
      cosines[f * num_blocks + block] = transformed(frequencies_[f].v, frequencies_[f].u);
    }
  }
  return cosines;
}

std::vector<float> BlockCosines::Back(std::span<const float> cosines) const {
  std::vector<float> image(cosines.begin(), cosines.end());
  if (frequencies_.size() == 1) {
    return image;
  }
  const Eigen::Map<const Rows> matrix(matrix_.data(), side_, side_);
  const size_t num_blocks = cosines.size() / frequencies_.size();
  Rows from(side_, side_);
  for (size_t block = 0; block < num_blocks; ++block) {
    for (size_t f = 0; f < frequencies_.size(); ++f) {
      from(frequencies_[f].v, frequencies_[f].u) = cosines[f * num_blocks + block];
    }
    Eigen::Map<Rows>(image.data() + block * frequencies_.size(), side_, side_) =
        matrix.transpose() * from * matrix;
  }
  return image;
}

LayerSum::LayerSum(LayerBlocks blocks, std::vector<uint32_t> coefficients, std::vector<float> mean,
                   std::vector<float> scale)
    : blocks_(std::move(blocks)),
      coefficients_(std::move(coefficients)),
      mean_(std::move(mean)),
      scale_(std::move(scale)),
      factors_(blocks_.StepFactors()),
      transform_(blocks_.side) {}

absl::Status LayerSum::Check(const TileSetLayer& layer) const {
  if (!std::isfinite(layer.step) || layer.step <= 0.0F) {
    return absl::InvalidArgumentError(absl::StrCat("layer's step ", layer.step, ", expected above 0"));
  }
  const size_t components = basis_.size() + layer.basis_step.size();
  const size_t pixels = blocks_.num_pixels();
  if (components > kMostLayerComponents || components > kMostLayerValues / std::max<size_t>(pixels, 1)) {
    return absl::InvalidArgumentError(absl::StrCat("layer's components: ", components, " in all of ", pixels,
                                                   " pixels, at most ", kMostLayerComponents, ", and ",
                                                   kMostLayerValues, " values"));
  }
  const auto is_step = [](float step) { return std::isfinite(step) && step >= 0.0F; };
  if (!std::ranges::all_of(layer.basis_step, is_step)) {
    return absl::InvalidArgumentError("layer's basis_step: expected finite steps from 0");
  }
  const size_t basis = layer.basis_step.size() * coefficients_.size();
  if (layer.basis.size() != basis || layer.codes.size() != components * pixels) {
    return absl::InvalidArgumentError(absl::StrCat("layer's basis: ", layer.basis.size(), " of ", basis,
                                                   " codes, images: ", layer.codes.size(), " of ",
                                                   components * pixels));
  }
  return absl::OkStatus();
}

absl::Status LayerSum::Add(const TileSetLayer& layer) {
  TESSERA_RETURN_IF_ERROR(Check(layer));
  auto code = layer.basis.begin();
  for (const float step : layer.basis_step) {
    std::vector<float> basis;
    for (const uint32_t coefficient : coefficients_) {
      basis.push_back(scale_[coefficient] * step * static_cast<float>(*code++));
    }
    basis_.push_back(std::move(basis));
    cosines_.emplace_back(blocks_.num_pixels(), 0.0F);
    images_.emplace_back(blocks_.num_pixels(), 0.0F);
  }
  auto from = layer.codes.begin();
  for (size_t c = 0; c < basis_.size(); ++c) {
    for (size_t f = 0; f < factors_.size(); ++f) {
      const float step = layer.step * factors_[f];
      for (size_t block = 0; block < blocks_.size(); ++block) {
        cosines_[c][f * blocks_.size() + block] += step * static_cast<float>(*from++);
      }
    }
    images_[c] = transform_.Back(cosines_[c]);
  }
  return absl::OkStatus();
}

float LayerSum::Bound() const {
  const auto largest = [](const std::vector<float>& values) {
    float most = 0.0F;
    for (const float value : values) {
      most = std::isfinite(value) ? std::max(most, std::abs(value)) : INFINITY;
      if (!std::isfinite(most)) {
        break;
      }
    }
    return most;
  };
  float bound = largest(mean_);
  for (size_t c = 0; c < basis_.size(); ++c) {
    bound += largest(images_[c]) * largest(basis_[c]);
  }
  return bound;
}

std::vector<float> LayerSum::Coefficients(std::span<const uint32_t> btfels, size_t per_row) const {
  const auto rows = static_cast<Eigen::Index>(btfels.size() / per_row);
  const auto k = static_cast<Eigen::Index>(mean_.size());
  Rows images = Rows::Zero(rows, static_cast<Eigen::Index>(basis_.size()));
  Rows basis = Rows::Zero(images.cols(), k);
  for (size_t c = 0; c < basis_.size(); ++c) {
    const auto component = static_cast<Eigen::Index>(c);
    for (size_t i = 0; i < btfels.size(); ++i) {
      images(static_cast<Eigen::Index>(i / per_row), component) += images_[c][blocks_.places[btfels[i]]];
    }
    for (size_t i = 0; i < coefficients_.size(); ++i) {
      basis(component, coefficients_[i]) = basis_[c][i];
    }
  }
  images /= static_cast<float>(per_row);
  std::vector<float> values(static_cast<size_t>(rows) * mean_.size());
  Eigen::Map<Rows> map(values.data(), rows, k);
  map = Eigen::Map<const Eigen::RowVectorXf>(mean_.data(), k).replicate(rows, 1);
  map.noalias() += images * basis;
  return values;
}

}  // namespace tessera
