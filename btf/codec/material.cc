#include "btf/codec/material.h"

#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/codec/btfel_table_io.h"
#include "btf/codec/container.h"

namespace tessera {
namespace {

constexpr char kMaterialKind[] = "material";
constexpr char kProducer[] = "tessera";

}  // namespace

absl::StatusOr<ContainerFile> MaterialFile(const Material& material) {
  Container container;
  container.kind = kMaterialKind;
  container.header = material.other_keys;
  container.header["producer"] = kProducer;
  container.header["radiometry"] = material.radiometry;
  container.header["metadata"] = material.metadata;
  AddProvenance(material.provenance, container);
  TESSERA_RETURN_IF_ERROR(AddSharedTables(material.btfels, container));
  TESSERA_RETURN_IF_ERROR(AddCoefficients(material.btfels, {material.height, material.width}, container));
  return ContainerFile::Create(std::move(container));
}

absl::StatusOr<std::string> SerializeMaterial(const Material& material) {
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
  return file.ReadAll();
}

absl::StatusOr<Material> ParseMaterial(std::span<const std::byte> bytes) {
  TESSERA_ASSIGN_OR_RETURN(Container container, ParseContainer(bytes));
  TESSERA_RETURN_IF_ERROR(RequireKind(container, kMaterialKind));
  Material material;
  TESSERA_ASSIGN_OR_RETURN(material.btfels, ReadSharedTables(container));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<int64_t> extents,
                           ReadCoefficients(container, /*rank=*/2, material.btfels));
  material.height = static_cast<int>(extents[0]);
  material.width = static_cast<int>(extents[1]);
  TESSERA_ASSIGN_OR_RETURN(material.provenance, ReadProvenance(container));
  TESSERA_ASSIGN_OR_RETURN(material.radiometry, HeaderString(container.header, "radiometry"));
  if (const auto metadata = container.header.find("metadata"); metadata != container.header.end()) {
    material.metadata = *metadata;
  }
  for (const char* known : {"producer", "source", "licence", "citation", "radiometry", "codec", "metadata"}) {
    container.header.erase(known);
  }
  material.other_keys = std::move(container.header);
  return material;
}

}  // namespace tessera
