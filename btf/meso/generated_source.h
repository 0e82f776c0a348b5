// A generated BTF named by one line of text, as provenance records it and as people type it.
//
//   TESSERA_ASSIGN_OR_RETURN(GenerateParams params, ParseGeneratedSource("generated:weave,size=64,seed=3"));
#pragma once

#include <string_view>

#include <absl/status/statusor.h>

#include "btf/meso/generate.h"

namespace tessera {

inline constexpr std::string_view kGeneratedPrefix = "generated:";

// "generated:KIND" and, each at most once, ",key=value" with the keys size, seed, height-scale, area-samples,
// bounces (GenerateParams), views and lights (names of DirectionSet; "ubo81" where they are left out), and
// for KIND heightmap height, colour and roughness (image files). Reads back what GenerateBtf records in
// provenance, which holds neither directions nor files. Errors: INVALID_ARGUMENT naming the key or value and
// what is legal; CheckGenerateParams's; those of reading the images.
[[nodiscard]] absl::StatusOr<GenerateParams> ParseGeneratedSource(std::string_view text);

}  // namespace tessera
