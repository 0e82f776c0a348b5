// A compressed BTF: one BTFel a texel, as stored in a container of kind "material" (codec/FORMAT.md).
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/codec/btfel_table.h"
#include "btf/codec/container.h"

namespace tessera {

struct Material {
  int width = 0;
  int height = 0;
  BtfelTable btfels;  // [height * width], row 0 on top
  Provenance provenance;
  std::string radiometry;
  // Recorded facts for people and tools: generator parameters, error figures. No times: same input, same
  // bytes.
  nlohmann::json metadata = nlohmann::json::object();
  // Header keys that this version does not know; written back as they were.
  nlohmann::json other_keys = nlohmann::json::object();
};

// The container, its codes not copied: `material` must stay alive and unchanged. Errors: INVALID_ARGUMENT
// when shapes disagree, ContainerFile's.
[[nodiscard]] absl::StatusOr<ContainerFile> MaterialFile(const Material& material);
// All bytes of it.
[[nodiscard]] absl::StatusOr<std::string> SerializeMaterial(const Material& material);
// Errors: INVALID_ARGUMENT or DATA_LOSS naming the section and the limit; safe on hostile bytes.
[[nodiscard]] absl::StatusOr<Material> ParseMaterial(std::span<const std::byte> bytes);

}  // namespace tessera
