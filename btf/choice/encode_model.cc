#include "btf/choice/encode_model.h"

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/reason.h"
#include "btf/base/status_macros.h"
#include "btf/choice/choice.h"
#include "btf/choice/ladder.h"
#include "btf/choice/setting_meter.h"
#include "btf/codec/container.h"
#include "btf/codec/diagnosis.h"

namespace tessera {
namespace {

absl::Status Invalid(std::string_view field, const std::string& message) {
  return WithReason(absl::InvalidArgumentError(message), "ARGUMENT_INVALID",
                    std::string("encode.").append(field));
}

absl::StatusOr<uint64_t> ContainerBytes(const Material& material) {
  TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
  return file.size_bytes();
}

// Puts the choice into the material's metadata, with the bytes of the container that it makes: they are
// returned.
absl::StatusOr<uint64_t> RecordChoice(const ModelChoice& choice, ModelChooser& chooser, Material& material) {
  // The number is part of what it counts. It settles at once, or, where it gains a digit, one time later.
  constexpr int kAttempts = 3;
  uint64_t bytes = 0;
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    material.metadata["choice"] = chooser.Record(choice);
    TESSERA_ASSIGN_OR_RETURN(bytes, ContainerBytes(material));
    SettingFigures figures = chooser.FiguresOf(choice);
    if (figures.bytes == bytes) {
      break;
    }
    figures.bytes = bytes;
    chooser.Correct(choice, figures);
  }
  return bytes;
}

absl::StatusOr<Material> EncodeByChoice(BtfSource& source, const ModelRequest& request,
                                        const RunContext& context) {
  const ModelGoal goal{.max_error = request.params.max_error,
                       .max_bytes = request.params.max_bytes,
                       .light = request.scene_light.value_or(SceneLight::kPoint)};
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SettingMeter> meter,
                           SettingMeter::Create(source, request.params, context));
  ModelChooser chooser(
      goal, ChoiceLadders(source.info(), request.params),
      [&meter](const std::string& codec, const Setting& setting) { return meter->Measure(codec, setting); });
  while (true) {
    TESSERA_ASSIGN_OR_RETURN(const ModelChoice choice, chooser.Choose());
    const std::string& codec = chooser.CodecOf(choice);
    const Setting& setting = chooser.SettingOf(choice);
    if (!chooser.FiguresOf(choice).of_all_texels) {
      TESSERA_ASSIGN_OR_RETURN(const SettingFigures figures, meter->MeasureWhole(codec, setting));
      chooser.Correct(choice, figures);
      // Sizes are compared by what parts of the texture show; a bound on the error is met by all of it.
      if (goal.max_error > 0.0) {
        continue;
      }
    }
    TESSERA_ASSIGN_OR_RETURN(Material material, FindCodec(codec)->Encode(source, setting.params, context));
    SettingFigures figures = chooser.FiguresOf(choice);
    TESSERA_ASSIGN_OR_RETURN(figures.sampled_rmse, meter->SampledError(material));
    chooser.Correct(choice, figures);
    if (goal.max_error > 0.0 && figures.error() > goal.max_error) {
      continue;
    }
    TESSERA_RETURN_IF_ERROR(RecordDiagnosis(source, context, material));
    TESSERA_ASSIGN_OR_RETURN(const uint64_t bytes, RecordChoice(choice, chooser, material));
    if (goal.max_bytes == 0 || bytes <= goal.max_bytes) {
      return material;
    }
  }
}

}  // namespace

absl::Status CheckModelRequest(const ModelRequest& request) {
  const bool is_auto = request.codec == kAutoCodec;
  if (!is_auto && FindCodec(request.codec) == nullptr) {
    std::string known;
    for (const std::string_view id : CodecIds()) {
      known.append(id).append(", ");
    }
    return Invalid("codec",
                   absl::StrCat("unknown codec \"", request.codec, "\", known: ", known, kAutoCodec));
  }
  const EncodeParams& params = request.params;
  if (!(params.max_error >= 0.0 && std::isfinite(params.max_error))) {
    return Invalid("max_error",
                   absl::StrCat("max_error = ", params.max_error, ", expected a finite number above 0"));
  }
  struct Field {
    const char* name;
    bool is_set;
    const char* codecs;  // that have it
    bool is_theirs;
  };
  const bool is_dfmf = request.codec == "dfmf";
  for (const Field& field : {Field{"rank", params.rank != 0, "dfmf", is_dfmf},
                             Field{"max_error", params.max_error > 0.0, "dfmf and auto", is_dfmf || is_auto},
                             Field{"max_bytes", params.max_bytes > 0, "dfmf and auto", is_dfmf || is_auto},
                             Field{"scene_light", request.scene_light.has_value(), "auto", is_auto}}) {
    if (field.is_set && !field.is_theirs) {
      return Invalid(field.name,
                     absl::StrCat(field.name, " is for ", field.codecs, ", the codec is ", request.codec));
    }
  }
  const int num_bounds =
      (params.rank != 0 ? 1 : 0) + (params.max_error > 0.0 ? 1 : 0) + (params.max_bytes > 0 ? 1 : 0);
  if (num_bounds > 1) {
    return Invalid("max_error",
                   absl::StrCat("rank = ", params.rank, ", max_error = ", params.max_error,
                                ", max_bytes = ", params.max_bytes, ": at most one of them may be set"));
  }
  if (is_auto && num_bounds == 0) {
    return Invalid("max_error", "codec auto needs max_error or max_bytes");
  }
  return absl::OkStatus();
}

absl::StatusOr<Material> EncodeModel(BtfSource& source, const ModelRequest& request,
                                     const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckModelRequest(request));
  if (request.codec == kAutoCodec) {
    return EncodeByChoice(source, request, context);
  }
  TESSERA_ASSIGN_OR_RETURN(Material material,
                           FindCodec(request.codec)->Encode(source, request.params, context));
  TESSERA_RETURN_IF_ERROR(RecordDiagnosis(source, context, material));
  return material;
}

}  // namespace tessera
