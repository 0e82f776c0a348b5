#include "btf/measure/held_out.h"

#include <memory>
#include <numeric>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

std::vector<int> All(size_t count) {
  std::vector<int> indices(count);
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

}  // namespace

const char* SplitName(Split split) {
  switch (split) {
    case Split::kSampled:
      return "sampled";
    case Split::kHeldOutLights:
      return "held-out lights";
    case Split::kHeldOutViews:
      return "held-out views";
  }
  return "";
}

bool SplitExists(const BtfInfo& info, Split split) {
  switch (split) {
    case Split::kSampled:
      return true;
    case Split::kHeldOutLights:
      return !HeldOutDirections(info.lights.size()).empty();
    case Split::kHeldOutViews:
      return !HeldOutDirections(info.views.size()).empty();
  }
  return false;
}

BtfSubset EncodedPart(const BtfInfo& info, Split split) {
  BtfSubset part;
  if (split == Split::kHeldOutLights) {
    part.lights = KeptDirections(info.lights.size());
  } else if (split == Split::kHeldOutViews) {
    part.views = KeptDirections(info.views.size());
  }
  return part;
}

PairSet MeasuredPairs(const BtfInfo& info, Split split) {
  return {split == Split::kHeldOutViews ? HeldOutDirections(info.views.size()) : All(info.views.size()),
          split == Split::kHeldOutLights ? HeldOutDirections(info.lights.size()) : All(info.lights.size())};
}

absl::StatusOr<HeldOutErrors> MeasureHeldOut(BtfSource& source, const Codec& codec,
                                             const EncodeParams& params, const HeldOutOptions& options,
                                             const RunContext& context) {
  HeldOutErrors result;
  const BtfInfo& info = source.info();
  for (const Split split : {Split::kSampled, Split::kHeldOutLights, Split::kHeldOutViews}) {
    if (!SplitExists(info, split)) {
      continue;
    }
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<SubsetBtf> part,
                             SubsetBtf::Create(source, EncodedPart(info, split)));
    // A part that is everything is read without a copy.
    BtfSource& encoded = split == Split::kSampled ? source : *part;
    TESSERA_ASSIGN_OR_RETURN(const Material material, codec.Encode(encoded, params, context));
    TESSERA_ASSIGN_OR_RETURN(
        const PairErrors errors,
        MeasureMaterial(source, material, MeasuredPairs(info, split), options.row_stride, context));
    const SquareSums total = Total(errors);
    if (split == Split::kSampled) {
      TESSERA_ASSIGN_OR_RETURN(const ContainerFile file, MaterialFile(material));
      result.size_bytes = file.size_bytes();
      result.sampled_rmse = total.rmse();
      result.reference_rms = total.reference_rms();
    } else {
      (split == Split::kHeldOutLights ? result.lights_rmse : result.views_rmse) = total.rmse();
    }
  }
  return result;
}

}  // namespace tessera
