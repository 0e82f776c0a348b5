#include "btf/wang/tile_set_layers.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/math/conventions.h"

namespace tessera {

std::vector<TileFrequency> TileFrequencies(int tile_size) {
  std::vector<TileFrequency> frequencies;
  for (int v = 0; v < tile_size; ++v) {
    for (int u = 0; u < tile_size; ++u) {
      frequencies.push_back({u, v});
    }
  }
  std::ranges::stable_sort(frequencies, [](const TileFrequency& a, const TileFrequency& b) {
    return std::tuple(a.u + a.v, a.v) < std::tuple(b.u + b.v, b.v);
  });
  return frequencies;
}

float StepFactor(const TileFrequency& frequency, int tile_size) {
  return 2 * std::max(frequency.u, frequency.v) >= tile_size && tile_size > 1 ? 2.0F : 1.0F;
}

TileCosines::TileCosines(int tile_size) : matrix_(tile_size, tile_size) {
  for (int u = 0; u < tile_size; ++u) {
    const double norm = std::sqrt((u == 0 ? 1.0 : 2.0) / tile_size);
    for (int x = 0; x < tile_size; ++x) {
      matrix_(u, x) = static_cast<float>(norm * std::cos(kPi * (2 * x + 1) * u / (2 * tile_size)));
    }
  }
}

LayerSum::LayerSum(int tile_size, size_t num_tiles, std::vector<float> mean, std::vector<float> scale)
    : tile_size_(tile_size),
      num_tiles_(num_tiles),
      mean_(std::move(mean)),
      scale_(std::move(scale)),
      frequencies_(TileFrequencies(tile_size)),
      transform_(tile_size) {}

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
  if (components > kMostLayerComponents) {
    return absl::InvalidArgumentError(
        absl::StrCat("layer's components: ", components, " in all, at most ", kMostLayerComponents));
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
  if (layer.basis.size() != basis || layer.codes.size() != components * num_texels()) {
    return absl::InvalidArgumentError(absl::StrCat("layer's basis: ", layer.basis.size(), " of ", basis,
                                                   " codes, images: ", layer.codes.size(), " of ",
                                                   components * num_texels()));
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
    cosines_.emplace_back(num_texels(), 0.0F);
    images_.emplace_back(num_texels(), 0.0F);
  }
  auto from = layer.codes.begin();
  for (size_t c = 0; c < spans_.size(); ++c) {
    for (size_t f = 0; f < frequencies_.size(); ++f) {
      const float step = layer.step * StepFactor(frequencies_[f], tile_size_);
      for (size_t tile = 0; tile < num_tiles_; ++tile) {
        cosines_[c][f * num_tiles_ + tile] += step * static_cast<float>(*from++);
      }
    }
    FloatRows cosines(tile_size_, tile_size_);
    for (size_t tile = 0; tile < num_tiles_; ++tile) {
      for (size_t f = 0; f < frequencies_.size(); ++f) {
        cosines(frequencies_[f].v, frequencies_[f].u) = cosines_[c][f * num_tiles_ + tile];
      }
      Eigen::Map<FloatRows>(images_[c].data() + tile * frequencies_.size(), tile_size_, tile_size_) =
          transform_.Back(cosines);
    }
  }
  return absl::OkStatus();
}

FloatRows LayerSum::Coefficients(std::span<const uint32_t> texels) const {
  const auto rows = static_cast<Eigen::Index>(texels.size());
  FloatRows values =
      Eigen::Map<const Eigen::RowVectorXf>(mean_.data(), static_cast<Eigen::Index>(mean_.size()))
          .replicate(rows, 1);
  for (size_t layer = 0; layer < coefficients_.size(); ++layer) {
    const std::vector<uint32_t>& columns = coefficients_[layer];
    const auto count = std::ranges::count(spans_, static_cast<uint32_t>(layer));
    FloatRows images(rows, count);
    FloatRows basis(count, static_cast<Eigen::Index>(columns.size()));
    Eigen::Index to = 0;
    for (size_t c = 0; c < spans_.size(); ++c) {
      if (spans_[c] == layer) {
        for (Eigen::Index row = 0; row < rows; ++row) {
          images(row, to) = images_[c][texels[static_cast<size_t>(row)]];
        }
        basis.row(to++) = Eigen::Map<const Eigen::RowVectorXf>(basis_[c].data(), basis.cols());
      }
    }
    const FloatRows added = images * basis;
    for (size_t i = 0; i < columns.size(); ++i) {
      values.col(columns[i]) += added.col(static_cast<Eigen::Index>(i));
    }
  }
  return values;
}

}  // namespace tessera
