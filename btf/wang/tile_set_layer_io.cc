#include "btf/wang/tile_set_layer_io.h"

#include <algorithm>
#include <array>
#include <limits>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/wang/tile_set_parts_layout.h"

namespace tessera {
namespace {

constexpr uint32_t kLarge = 255;

// 0, -1, 1, -2, 2, .. as 0, 1, 2, ..
uint32_t Folded(int32_t code) {
  return code >= 0 ? 2 * static_cast<uint32_t>(code) : 2 * static_cast<uint32_t>(-(code + 1)) + 1;
}
int32_t Unfolded(uint32_t folded) {
  const auto half = static_cast<int32_t>(folded / 2);
  return folded % 2 == 0 ? half : -half - 1;
}

class CodeWriter {
 public:
  void Write(int32_t code) {
    const uint32_t folded = Folded(code);
    if (folded >= kLarge) {
      large_.push_back(folded);
    }
    small_.push_back(static_cast<uint8_t>(std::min(folded, kLarge)));
  }
  // As sections `name` and `name`_large.
  void AddSections(const std::string& name, Container& container) const {
    container.sections.push_back(Compressed(
        MakeSection<uint8_t>(name, {static_cast<int64_t>(small_.size())}, std::span<const uint8_t>(small_))));
    container.sections.push_back(Compressed(MakeSection<uint32_t>(
        name + "_large", {static_cast<int64_t>(large_.size())}, std::span<const uint32_t>(large_))));
  }

 private:
  std::vector<uint8_t> small_;
  std::vector<uint32_t> large_;
};

absl::StatusOr<std::vector<int32_t>> ReadCodes(const Container& container, const std::string& name,
                                               size_t count) {
  const std::array<int64_t, 1> shape = {static_cast<int64_t>(count)};
  TESSERA_ASSIGN_OR_RETURN(const Section* small, RequireSection(container, name, DType::kU8, shape));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> large,
                           ReadVector<uint32_t>(container, name + "_large"));
  std::vector<int32_t> codes;
  codes.reserve(count);
  auto next = large.begin();
  for (const char byte : small->bytes) {
    uint32_t folded = static_cast<uint8_t>(byte);
    if (folded == kLarge && next != large.end()) {
      folded = *next++;
    }
    codes.push_back(Unfolded(folded));
  }
  if (next != large.end() ||
      std::ranges::count(small->bytes, static_cast<char>(kLarge)) != std::ssize(large)) {
    return absl::InvalidArgumentError(absl::StrCat("section '", name, "_large': ", large.size(),
                                                   " values, expected one for each 255 of '", name, "'"));
  }
  return codes;
}

}  // namespace

void AddLayerSections(const TileSetLayers& layers, size_t index, std::span<const uint32_t> blocks,
                      size_t num_blocks, Container& container) {
  const TileSetLayer& layer = layers.layers[index];
  const auto add = [&container]<typename T>(const char* name, const std::vector<T>& values) {
    container.sections.push_back(
        Compressed(MakeSection<T>(name, {static_cast<int64_t>(values.size())}, std::span<const T>(values))));
  };
  size_t components = 0;
  for (size_t i = 0; i <= index; ++i) {
    components += layers.layers[i].spans.size();
  }
  add("coefficients", layer.coefficients);
  add("layer_step", std::vector<float>{layer.step});
  add("spans", layer.spans);
  add("basis_step", layer.basis_step);
  CodeWriter basis;
  std::ranges::for_each(layer.basis, [&basis](int32_t code) { basis.Write(code); });
  basis.AddSections("basis", container);
  const size_t frequencies = components == 0 ? 0 : layer.codes.size() / components / num_blocks;
  CodeWriter codes;
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
        codes.Write(component[f * num_blocks + block]);
      }
    }
  }
  add("reach", reach);
  codes.AddSections("codes", container);
}

absl::StatusOr<TileSetLayer> ReadLayerSections(const Container& container, const LayerSum& sum) {
  TileSetLayer layer;
  TESSERA_ASSIGN_OR_RETURN(layer.coefficients, ReadVector<uint32_t>(container, "coefficients"));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<float> step, ReadVector<float>(container, "layer_step"));
  TESSERA_ASSIGN_OR_RETURN(layer.spans, ReadVector<uint32_t>(container, "spans"));
  TESSERA_ASSIGN_OR_RETURN(layer.basis_step, ReadVector<float>(container, "basis_step"));
  if (step.size() != 1) {
    return absl::InvalidArgumentError(
        absl::StrCat("section 'layer_step': ", step.size(), " values, expected 1"));
  }
  layer.step = step[0];
  size_t basis = 0;
  for (const uint32_t span : layer.spans) {
    if (span > sum.num_layers()) {
      return absl::InvalidArgumentError(
          absl::StrCat("section 'spans': layer ", span, ", expected at most ", sum.num_layers()));
    }
    basis += span == sum.num_layers() ? layer.coefficients.size() : sum.coefficients(span).size();
  }
  TESSERA_ASSIGN_OR_RETURN(layer.basis, ReadCodes(container, "basis", basis));
  const size_t components = sum.num_components() + layer.spans.size();
  TESSERA_ASSIGN_OR_RETURN(const std::vector<uint32_t> reach, ReadVector<uint32_t>(container, "reach"));
  const size_t frequencies = sum.num_btfels() / sum.num_blocks();
  const bool too_far = std::ranges::any_of(reach, [frequencies](uint32_t r) { return r > frequencies; });
  if (reach.size() != components || too_far || components > kMostLayerValues / sum.num_btfels()) {
    return absl::InvalidArgumentError(absl::StrCat(
        "section 'reach': ", reach.size(), " values, expected ", components, " of at most ", frequencies,
        ", for ", sum.num_btfels(), " BTFels at most ", kMostLayerValues / sum.num_btfels()));
  }
  size_t count = 0;
  for (const uint32_t frequency : reach) {
    count += frequency * sum.num_blocks();
  }
  TESSERA_ASSIGN_OR_RETURN(const std::vector<int32_t> codes, ReadCodes(container, "codes", count));
  layer.codes.assign(components * sum.num_btfels(), 0);
  auto from = codes.begin();
  for (size_t c = 0; c < components; ++c) {
    const auto btfels = static_cast<std::ptrdiff_t>(reach[c] * sum.num_blocks());
    std::copy_n(from, btfels, layer.codes.begin() + static_cast<std::ptrdiff_t>(c * sum.num_btfels()));
    from += btfels;
  }
  return layer;
}

}  // namespace tessera
