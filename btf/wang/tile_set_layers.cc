#include "btf/wang/tile_set_layers.h"

#include <algorithm>
#include <cmath>
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

float StepFactor(const BlockFrequency& frequency, int block_side) {
  return 2 * std::max(frequency.u, frequency.v) >= block_side && block_side > 1 ? 2.0F : 1.0F;
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

LayerSum::LayerSum(int block_side, size_t num_blocks, std::vector<float> mean, std::vector<float> scale)
    : block_side_(block_side),
      num_blocks_(num_blocks),
      mean_(std::move(mean)),
      scale_(std::move(scale)),
      frequencies_(BlockFrequencies(block_side)),
      transform_(block_side) {}

absl::Status LayerSum::Check(const TileSetLayer& layer) const {
  if (!std::isfinite(layer.step) || layer.step <= 0.0F) {
    return absl::InvalidArgumentError(absl::StrCat("layer's step ", layer.step, ", expected above 0"));
  }
  std::vector<bool> taken(mean_.size(), false);
  for (const std::vector<uint32_t>& held : coefficients_) {
    for (const uint32_t coefficient : held) {
      taken[coefficient] = true;
    }
  }
  for (const uint32_t coefficient : layer.coefficients) {
    if (coefficient >= taken.size() || taken[coefficient]) {
      return absl::InvalidArgumentError(absl::StrCat("layer's coefficients: ", coefficient, " of ",
                                                     taken.size(), " is out of range or came before"));
    }
    taken[coefficient] = true;
  }
  const size_t components = spans_.size() + layer.spans.size();
  if (components > kMostLayerComponents ||
      components > kMostLayerValues / std::max<size_t>(num_btfels(), 1)) {
    return absl::InvalidArgumentError(absl::StrCat("layer's components: ", components, " in all of ",
                                                   num_btfels(), " BTFels, at most ", kMostLayerComponents,
                                                   ", and ", kMostLayerValues, " values"));
  }
  size_t basis = 0;
  for (const uint32_t span : layer.spans) {
    if (span > coefficients_.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat("layer's spans: layer ", span, ", expected at most ", coefficients_.size()));
    }
    basis += span == coefficients_.size() ? layer.coefficients.size() : coefficients_[span].size();
  }
  const auto is_step = [](float step) { return std::isfinite(step) && step >= 0.0F; };
  if (layer.basis_step.size() != layer.spans.size() || !std::ranges::all_of(layer.basis_step, is_step)) {
    return absl::InvalidArgumentError(absl::StrCat("layer's basis_step: ", layer.basis_step.size(),
                                                   " values, expected ", layer.spans.size(),
                                                   " finite ones from 0"));
  }
  if (layer.basis.size() != basis || layer.codes.size() != components * num_btfels()) {
    return absl::InvalidArgumentError(absl::StrCat("layer's basis: ", layer.basis.size(), " of ", basis,
                                                   " codes, images: ", layer.codes.size(), " of ",
                                                   components * num_btfels()));
  }
  return absl::OkStatus();
}

absl::Status LayerSum::Add(const TileSetLayer& layer) {
  TESSERA_RETURN_IF_ERROR(Check(layer));
  coefficients_.push_back(layer.coefficients);
  auto code = layer.basis.begin();
  for (size_t i = 0; i < layer.spans.size(); ++i) {
    std::vector<float> basis;
    for (const uint32_t coefficient : coefficients_[layer.spans[i]]) {
      basis.push_back(scale_[coefficient] * layer.basis_step[i] * static_cast<float>(*code++));
    }
    spans_.push_back(layer.spans[i]);
    basis_.push_back(std::move(basis));
    cosines_.emplace_back(num_btfels(), 0.0F);
    images_.emplace_back(num_btfels(), 0.0F);
  }
  auto from = layer.codes.begin();
  for (size_t c = 0; c < spans_.size(); ++c) {
    for (size_t f = 0; f < frequencies_.size(); ++f) {
      const float step = layer.step * StepFactor(frequencies_[f], block_side_);
      for (size_t block = 0; block < num_blocks_; ++block) {
        cosines_[c][f * num_blocks_ + block] += step * static_cast<float>(*from++);
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
  for (size_t c = 0; c < spans_.size(); ++c) {
    bound += largest(images_[c]) * largest(basis_[c]);
  }
  return bound;
}

std::vector<float> LayerSum::Coefficients(std::span<const uint32_t> btfels) const {
  const auto rows = static_cast<Eigen::Index>(btfels.size());
  const auto k = static_cast<Eigen::Index>(mean_.size());
  Rows images(rows, static_cast<Eigen::Index>(spans_.size()));
  Rows basis = Rows::Zero(images.cols(), k);
  for (size_t c = 0; c < spans_.size(); ++c) {
    const auto component = static_cast<Eigen::Index>(c);
    for (size_t i = 0; i < btfels.size(); ++i) {
      images(static_cast<Eigen::Index>(i), component) = images_[c][btfels[i]];
    }
    const std::vector<uint32_t>& columns = coefficients_[spans_[c]];
    for (size_t i = 0; i < columns.size(); ++i) {
      basis(component, columns[i]) = basis_[c][i];
    }
  }
  std::vector<float> values(btfels.size() * mean_.size());
  Eigen::Map<Rows> map(values.data(), rows, k);
  map = Eigen::Map<const Eigen::RowVectorXf>(mean_.data(), k).replicate(rows, 1);
  map.noalias() += images * basis;
  return values;
}

}  // namespace tessera
