#include "btf/meso/generate.h"

namespace tessera {

std::vector<std::string_view> GeneratorKinds() {
  return {"reactdiffuse", "holes", "wrinkles", "weave", "heightmap"};
}

absl::StatusOr<std::unique_ptr<BtfSource>> GenerateBtf(const GenerateParams& params, const RunContext&) {
  return absl::UnimplementedError("generator kind " + params.kind);
}

}  // namespace tessera
