// What a caller asks for when a BTF is to become a material: a codec with its parameters, or, with the codec
// "auto", a bound that the model has to meet.
//
//   const ModelRequest request{.codec = "auto", .params = {.max_error = 0.05}};
//   TESSERA_RETURN_IF_ERROR(CheckModelRequest(request));
//   TESSERA_ASSIGN_OR_RETURN(Material material, EncodeModel(*source, request, context));
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/codec/material.h"
#include "btf/codec/scene_light.h"
#include "btf/data/btf_source.h"

namespace tessera {

inline constexpr char kAutoCodec[] = "auto";

struct ModelRequest {
  std::string codec = "dsh-cls";  // an id of codec.h, or kAutoCodec
  // With kAutoCodec: max_error or max_bytes is the bound, memory_budget_bytes and spill_folder hold, the rest
  // is chosen.
  EncodeParams params;
  std::optional<SceneLight> scene_light;  // of kAutoCodec; none: kPoint
};

// What can be known without the BTF. Errors: INVALID_ARGUMENT with reason ARGUMENT_INVALID naming the codec
// and the known ones; rank, max_error, max_bytes or scene_light where the codec has none; two of the three
// bounds; or the bound that "auto" lacks.
[[nodiscard]] absl::Status CheckModelRequest(const ModelRequest& request);

// The material, its diagnosis (codec/diagnosis.h) and, with kAutoCodec, the choice (choice.h) in its
// metadata. Errors: CheckModelRequest's; Codec::Encode's; ChooseModel's.
[[nodiscard]] absl::StatusOr<Material> EncodeModel(BtfSource& source, const ModelRequest& request,
                                                   const RunContext& context);

}  // namespace tessera
