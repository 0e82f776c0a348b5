#include "btf/meso/generated_source.h"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>
#include <string>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/data/direction_sets.h"
#include "btf/image/image_io.h"

namespace tessera {
namespace {

constexpr char kKeys[] =
    "size, seed, height-scale, area-samples, bounces, views, lights, height, colour, roughness";

template <typename Number>
absl::Status ReadNumber(const std::string& key, const std::string& text, Number& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size()
             ? absl::OkStatus()
             : absl::InvalidArgumentError(
                   absl::StrCat("generated source: ", key, "=", text, " is no number"));
}

// Heights and roughness are measures, not colours: their codes are taken as they are.
absl::Status ReadPicture(const std::string& path, const std::optional<Transfer>& transfer,
                         std::optional<Image>& image) {
  TESSERA_ASSIGN_OR_RETURN(image, ReadImage(path, transfer));
  return absl::OkStatus();
}

absl::Status Set(const std::string& key, const std::string& value, GenerateParams& params) {
  if (key == "size") {
    return ReadNumber(key, value, params.size);
  }
  if (key == "seed") {
    return ReadNumber(key, value, params.seed);
  }
  if (key == "height-scale") {
    return ReadNumber(key, value, params.height_scale_texels);
  }
  if (key == "area-samples") {
    return ReadNumber(key, value, params.area_samples);
  }
  if (key == "bounces") {
    return ReadNumber(key, value, params.bounces);
  }
  if (key == "views" || key == "lights") {
    TESSERA_ASSIGN_OR_RETURN((key == "views" ? params.views : params.lights), DirectionSet(value));
    return absl::OkStatus();
  }
  if (key == "height") {
    return ReadPicture(value, Transfer::Linear(), params.height);
  }
  if (key == "colour") {
    return ReadPicture(value, std::nullopt, params.colour);
  }
  if (key == "roughness") {
    return ReadPicture(value, Transfer::Linear(), params.roughness);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("generated source: key \"", key, "\", expected one of ", kKeys));
}

}  // namespace

absl::StatusOr<GenerateParams> ParseGeneratedSource(std::string_view text) {
  if (!text.starts_with(kGeneratedPrefix)) {
    return absl::InvalidArgumentError(
        absl::StrCat("generated source \"", std::string(text), "\": expected generated:KIND[,key=value..]"));
  }
  text.remove_prefix(kGeneratedPrefix.size());
  GenerateParams params;
  TESSERA_ASSIGN_OR_RETURN(params.views, DirectionSet("ubo81"));
  TESSERA_ASSIGN_OR_RETURN(params.lights, DirectionSet("ubo81"));
  const size_t kind_end = std::min(text.find(','), text.size());
  params.kind = std::string(text.substr(0, kind_end));
  text.remove_prefix(kind_end);
  std::set<std::string> seen;
  while (!text.empty()) {
    text.remove_prefix(1);  // the comma
    const std::string item(text.substr(0, text.find(',')));
    text.remove_prefix(item.size());
    const size_t equals = item.find('=');
    if (equals == std::string::npos) {
      return absl::InvalidArgumentError(absl::StrCat("generated source: \"", item, "\", expected key=value"));
    }
    const std::string key = item.substr(0, equals);
    if (!seen.insert(key).second) {
      return absl::InvalidArgumentError(absl::StrCat("generated source: key \"", key, "\" twice"));
    }
    TESSERA_RETURN_IF_ERROR(Set(key, item.substr(equals + 1), params));
  }
  TESSERA_RETURN_IF_ERROR(CheckGenerateParams(params));
  return params;
}

}  // namespace tessera
