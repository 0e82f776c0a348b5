#include "btf/wang/tile_set_layer_io.h"

#include <algorithm>
#include <limits>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/range_coder.h"
#include "btf/wang/tile_set_parts_layout.h"

namespace tessera {
namespace {

constexpr char kLayerStep[] = "layer_step";

size_t SideOf(const AngularBasis& basis) {
  return basis.codes.size() / std::max<size_t>(basis.step.size(), 1);
}

// Numbers in rows of `stride`.
void AddCodes(const std::string& name, std::span<const int32_t> codes, size_t stride, Container& container) {
  AddVector(name, WriteNumbers(codes, stride), container);
}

absl::StatusOr<std::vector<int32_t>> ReadCodes(const Container& container, const std::string& name,
                                               size_t count, size_t stride) {
  if (count > kMostLayerValues) {
    return absl::InvalidArgumentError(
        absl::StrCat("section '", name, "': ", count, " codes, at most ", kMostLayerValues));
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, ReadVector<uint8_t>(container, name));
  std::vector<int32_t> codes(count);
  if (const absl::Status status = ReadNumbers(bytes, stride, codes); !status.ok()) {
    return absl::InvalidArgumentError(absl::StrCat("section '", name, "': ", status.message()));
  }
  return codes;
}

template <typename T>
absl::StatusOr<T> ReadSingle(const Container& container, const std::string& name) {
  TESSERA_ASSIGN_OR_RETURN(const std::vector<T> values, ReadVector<T>(container, name));
  if (values.size() != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("section '", name, "': ", values.size(), " values, expected 1"));
  }
  return values[0];
}

}  // namespace

void AddSharedSections(const TileSetLayers& layers, Container& container) {
  container.header["block_side"] = layers.block_side;
  container.header["level"] = layers.level;
  AddVector("coefficients", layers.coefficients, container);
  AddVector("mean", layers.mean, container);
  AddVector("scale", layers.scale, container);
  if (layers.bases.has_value()) {
    AddVector("core_mean", layers.bases->mean, container);
    AddVector("core_unit", layers.bases->unit, container);
    AddVector("view_basis_step", layers.bases->view.step, container);
    AddCodes("view_basis", layers.bases->view.codes, SideOf(layers.bases->view), container);
    AddVector("light_basis_step", layers.bases->light.step, container);
    AddCodes("light_basis", layers.bases->light.codes, SideOf(layers.bases->light), container);
  }
}

void AddLayerSections(const TileSetLayers& layers, size_t index, std::span<const uint32_t> blocks,
                      size_t num_blocks, Container& container) {
  const TileSetLayer& layer = layers.layers[index];
  size_t components = 0;
  for (size_t i = 0; i <= index; ++i) {
    components += layers.layers[i].basis_step.size();
  }
  AddVector(kLayerStep, std::vector<float>{layer.step}, container);
  AddVector("basis_step", layer.basis_step, container);
  AddCodes("basis", layer.basis, layers.coefficients.size(), container);
  if (!layer.cores.empty()) {
    AddVector("core_step", std::vector<float>{layer.core_step}, container);
    AddVector("core_reach", std::vector<uint32_t>{static_cast<uint32_t>(layer.cores.size())}, container);
    AddCodes("cores", layer.cores, layers.bases->mean.size(), container);
  }
  const size_t frequencies = components == 0 ? 0 : layer.codes.size() / components / num_blocks;
  std::vector<int32_t> codes;
  std::vector<uint32_t> reach;
  for (size_t c = 0; c < components; ++c) {
    // Behind the last code that is not 0 there is nothing to send.
    const auto component =
        std::span(layer.codes).subspan(c * frequencies * num_blocks, frequencies * num_blocks);
    size_t end = component.size();
    while (end > 0 && component[end - 1] == 0) {
      --end;
    }
    reach.push_back(static_cast<uint32_t>((end + num_blocks - 1) / num_blocks));
    for (size_t f = 0; f < reach.back(); ++f) {
      for (const uint32_t block : blocks) {
        codes.push_back(component[f * num_blocks + block]);
      }
    }
  }
  AddVector("reach", reach, container);
  AddCodes("codes", codes, blocks.size(), container);
}

bool HasLayer(const Container& container) {
  return container.Find(kLayerStep) != nullptr;
}

absl::StatusOr<TileSetLayers> ReadSharedSections(const Container& container, size_t num_coefficients,
                                                 size_t num_views, size_t num_lights) {
  TileSetLayers layers;
  TESSERA_ASSIGN_OR_RETURN(layers.block_side, ReadInteger(container.header, "block_side", 1, kMostBlockSide));
  TESSERA_ASSIGN_OR_RETURN(layers.level, ReadInteger(container.header, "level", 0, kMostLevel));
  TESSERA_ASSIGN_OR_RETURN(layers.coefficients, ReadVector<uint32_t>(container, "coefficients"));
  TESSERA_ASSIGN_OR_RETURN(layers.mean, ReadFinite(container, "mean", num_coefficients));
  TESSERA_ASSIGN_OR_RETURN(layers.scale, ReadFinite(container, "scale", num_coefficients));
  if (container.Find("core_mean") != nullptr) {
    CoreBases& bases = layers.bases.emplace();
    TESSERA_ASSIGN_OR_RETURN(bases.mean, ReadVector<float>(container, "core_mean"));
    TESSERA_ASSIGN_OR_RETURN(bases.unit, ReadVector<float>(container, "core_unit"));
    TESSERA_ASSIGN_OR_RETURN(bases.view.step, ReadVector<float>(container, "view_basis_step"));
    TESSERA_ASSIGN_OR_RETURN(
        bases.view.codes, ReadCodes(container, "view_basis", bases.view.step.size() * num_views, num_views));
    TESSERA_ASSIGN_OR_RETURN(bases.light.step, ReadVector<float>(container, "light_basis_step"));
    TESSERA_ASSIGN_OR_RETURN(bases.light.codes, ReadCodes(container, "light_basis",
                                                          bases.light.step.size() * num_lights, num_lights));
  }
  return layers;
}

absl::StatusOr<TileSetLayer> ReadLayerSections(const Container& container, const LayerSum& sum,
                                               size_t num_matrices) {
  TileSetLayer layer;
  TESSERA_ASSIGN_OR_RETURN(layer.step, ReadSingle<float>(container, kLayerStep));
  TESSERA_ASSIGN_OR_RETURN(layer.basis_step, ReadVector<float>(container, "basis_step"));
  TESSERA_ASSIGN_OR_RETURN(layer.basis,
                           ReadCodes(container, "basis", layer.basis_step.size() * sum.coefficients().size(),
                                     sum.coefficients().size()));
  if (container.Find("core_step") != nullptr) {
    TESSERA_ASSIGN_OR_RETURN(layer.core_step, ReadSingle<float>(container, "core_step"));
    TESSERA_ASSIGN_OR_RETURN(const uint32_t core_reach, ReadSingle<uint32_t>(container, "core_reach"));
    TESSERA_ASSIGN_OR_RETURN(layer.cores, ReadCodes(container, "cores", core_reach, num_matrices));
  }
  const size_t components = sum.num_components() + layer.basis_step.size();
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> reach, ReadVector<uint32_t>(container, "reach"));
  const size_t pixels = sum.blocks().num_pixels();
  const size_t frequencies = pixels / sum.blocks().size();
  const bool too_far = std::ranges::any_of(reach, [frequencies](uint32_t r) { return r > frequencies; });
  if (reach.size() != components || too_far || components > kMostLayerValues / pixels) {
    return absl::InvalidArgumentError(absl::StrCat("section 'reach': ", reach.size(), " values, expected ",
                                                   components, " of at most ", frequencies, ", for ", pixels,
                                                   " pixels at most ", kMostLayerValues / pixels));
  }
  size_t count = 0;
  for (const uint32_t frequency : reach) {
    count += frequency * sum.blocks().size();
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<int32_t> codes,
                           ReadCodes(container, "codes", count, sum.blocks().size()));
  layer.codes.assign(components * pixels, 0);
  auto from = codes.begin();
  for (size_t c = 0; c < components; ++c) {
    const auto values = static_cast<std::ptrdiff_t>(reach[c] * sum.blocks().size());
    std::copy_n(from, values, layer.codes.begin() + static_cast<std::ptrdiff_t>(c * pixels));
    from += values;
  }
  return layer;
}

}  // namespace tessera
