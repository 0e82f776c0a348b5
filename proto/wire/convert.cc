#include "proto/wire/convert.h"

#include <span>

#include <absl/strings/str_cat.h>

#include "btf/base/sha256.h"
#include "btf/base/status_macros.h"
#include "proto/wire/names.h"

namespace tessera {
namespace {

// Never throws: bytes that are not UTF-8 are replaced.
std::string JsonText(const nlohmann::json& json) {
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace

v1::Direction MessageFromDirection(const Direction& direction) {
  v1::Direction message;
  message.set_polar_deg(DegFromRad(direction.theta_rad));
  message.set_azimuth_deg(DegFromRad(direction.phi_rad));
  return message;
}

Direction DirectionFromMessage(const v1::Direction& message) {
  return {RadFromDeg(message.polar_deg()), RadFromDeg(message.azimuth_deg())};
}

v1::Provenance MessageFromProvenance(const Provenance& provenance) {
  v1::Provenance message;
  message.set_source(provenance.source);
  message.set_licence(provenance.licence);
  message.set_citation(provenance.citation);
  return message;
}

Provenance ProvenanceFromMessage(const v1::Provenance& message) {
  return {message.source(), message.licence(), message.citation()};
}

v1::Arrangement MessageFromArrangement(const Arrangement& arrangement) {
  v1::Arrangement message;
  message.set_name(ArrangementName(arrangement.id));
  message.set_sha256(arrangement.sha256);
  message.mutable_tile_codes()->Add(arrangement.codes.begin(), arrangement.codes.end());
  message.set_turned_strips(arrangement.turned_strips);
  message.set_num_colours(arrangement.num_colours);
  return message;
}

absl::StatusOr<Arrangement> ArrangementFromMessage(const v1::Arrangement& message) {
  Arrangement arrangement;
  TESSERA_ASSIGN_OR_RETURN(arrangement.id, ParseArrangementName(message.name()));
  arrangement.codes.assign(message.tile_codes().begin(), message.tile_codes().end());
  arrangement.turned_strips = message.turned_strips();
  if (message.num_colours() > kMostColours) {
    return absl::InvalidArgumentError(absl::StrCat(message.name(), ": ", message.num_colours(),
                                                   " colours, expected at most ", kMostColours));
  }
  if (message.num_colours() != 0) {
    arrangement.num_colours = static_cast<int>(message.num_colours());
  }
  for (size_t tile = 0; tile < arrangement.codes.size(); ++tile) {
    if (TileCode(arrangement.SidesOf(tile), arrangement.num_colours) != arrangement.codes[tile]) {
      return absl::InvalidArgumentError(absl::StrCat(message.name(), ": tile code ", arrangement.codes[tile],
                                                     " does not exist with ", arrangement.num_colours,
                                                     " colours"));
    }
  }
  const std::string listing = ArrangementListing(arrangement);
  arrangement.sha256 = Sha256Hex(std::as_bytes(std::span(listing)));
  if (arrangement.sha256 != message.sha256()) {
    return absl::InvalidArgumentError(absl::StrCat(message.name(), ": its codes have SHA-256 ",
                                                   arrangement.sha256, ", it claims ", message.sha256()));
  }
  return arrangement;
}

v1::Material MessageFromMaterial(const Material& material) {
  v1::Material message;
  message.set_width(material.width);
  message.set_height(material.height);
  message.set_codec(material.btfels.codec_id);
  message.set_num_coefficients(material.btfels.num_coefficients);
  message.set_num_views(material.btfels.views.size());
  message.set_num_lights(material.btfels.lights.size());
  *message.mutable_provenance() = MessageFromProvenance(material.provenance);
  message.set_radiometry(material.radiometry);
  message.set_metadata_json(JsonText(material.metadata));
  return message;
}

v1::TileSet MessageFromTileSet(const TileSet& tile_set) {
  v1::TileSet message;
  message.set_arrangement_sha256(tile_set.arrangement_sha256);
  message.set_tile_size(tile_set.tile_size);
  message.set_strip_height(tile_set.strip_height);
  message.set_num_tiles(tile_set.tile_codes.size());
  message.set_num_btfels(tile_set.btfels.size());
  message.set_codec(tile_set.btfels.codec_id);
  *message.mutable_provenance() = MessageFromProvenance(tile_set.provenance);
  message.set_certificate_json(JsonText(tile_set.certificate));
  message.set_metadata_json(JsonText(tile_set.metadata));
  return message;
}

void FillDefaults(v1::EncodeOptions& message) {
  const EncodeParams defaults;
  if (message.codec().empty()) {
    message.set_codec("dsh-cls");
  }
  if (message.kl() == 0) {
    message.set_kl(defaults.kl);
  }
  if (message.kv() == 0) {
    message.set_kv(defaults.kv);
  }
  if (message.eigen_textures() == 0) {
    message.set_eigen_textures(defaults.eigen_textures);
  }
  if (message.cls_energy().empty()) {
    message.set_cls_energy("hemisphere");
  }
  if (message.codec() == "dfmf" && message.rank() == 0 && message.max_error() == 0.0 &&
      message.max_bytes() == 0) {
    message.set_rank(kDefaultDfmfRank);
  }
  if (message.codec() == kAutoCodec && message.scene_light().empty()) {
    message.set_scene_light("point");
  }
}

absl::StatusOr<ModelRequest> ModelRequestFromMessage(const v1::EncodeOptions& message) {
  constexpr uint32_t kMaxCoefficients = 1u << 16;  // keeps the casts exact; the codec knows the real limit
  v1::EncodeOptions filled = message;
  FillDefaults(filled);
  for (const auto& [name, value] :
       {std::pair("kl", filled.kl()), std::pair("kv", filled.kv()),
        std::pair("eigen_textures", filled.eigen_textures()), std::pair("rank", filled.rank())}) {
    if (value > kMaxCoefficients) {
      return absl::InvalidArgumentError(absl::StrCat(name, " = ", value, ": at most ", kMaxCoefficients));
    }
  }
  ModelRequest request{.codec = filled.codec()};
  EncodeParams& params = request.params;
  params.kl = static_cast<int>(filled.kl());
  params.kv = static_cast<int>(filled.kv());
  params.eigen_textures = static_cast<int>(filled.eigen_textures());
  params.rank = static_cast<int>(filled.rank());
  params.max_error = filled.max_error();
  params.max_bytes = filled.max_bytes();
  if (filled.cls_energy() == "sphere") {
    params.cls_energy = ClsEnergy::kSphere;
  } else if (filled.cls_energy() != "hemisphere") {
    return absl::InvalidArgumentError(
        absl::StrCat("cls_energy \"", filled.cls_energy(), "\", expected hemisphere or sphere"));
  }
  if (!filled.scene_light().empty()) {
    request.scene_light = FindSceneLight(filled.scene_light());
    if (!request.scene_light) {
      return absl::InvalidArgumentError(
          absl::StrCat("scene_light \"", filled.scene_light(), "\", expected point or environment"));
    }
  }
  return request;
}

Light LightFromMessage(const v1::Light& message) {
  Light light;
  light.kind = message.kind() == v1::Light::POINT ? Light::Kind::kPoint : Light::Kind::kDirectional;
  light.place = {message.x(), message.y(), message.z()};
  if (message.red() != 0 || message.green() != 0 || message.blue() != 0) {
    light.irradiance = {message.red(), message.green(), message.blue()};
  }
  return light;
}

v1::Light MessageFromLight(const Light& light) {
  v1::Light message;
  message.set_kind(light.kind == Light::Kind::kPoint ? v1::Light::POINT : v1::Light::DIRECTIONAL);
  message.set_x(light.place.x());
  message.set_y(light.place.y());
  message.set_z(light.place.z());
  message.set_red(light.irradiance.x());
  message.set_green(light.irradiance.y());
  message.set_blue(light.irradiance.z());
  return message;
}

Camera CameraFromMessage(const v1::Camera& message) {
  Camera camera;
  camera.eye = {message.eye_x(), message.eye_y(), message.eye_z()};
  camera.target = {message.target_x(), message.target_y(), message.target_z()};
  if (message.fov_y_deg() != 0) {
    camera.fov_y_rad = RadFromDeg(message.fov_y_deg());
  }
  if (message.up_x() != 0 || message.up_y() != 0 || message.up_z() != 0) {
    camera.up = {message.up_x(), message.up_y(), message.up_z()};
  }
  return camera;
}

v1::Camera MessageFromCamera(const Camera& camera) {
  v1::Camera message;
  message.set_eye_x(camera.eye.x());
  message.set_eye_y(camera.eye.y());
  message.set_eye_z(camera.eye.z());
  message.set_target_x(camera.target.x());
  message.set_target_y(camera.target.y());
  message.set_target_z(camera.target.z());
  message.set_fov_y_deg(DegFromRad(camera.fov_y_rad));
  message.set_up_x(camera.up.x());
  message.set_up_y(camera.up.y());
  message.set_up_z(camera.up.z());
  return message;
}

Orbit OrbitFromMessage(const v1::Orbit& message) {
  Orbit orbit{.azimuth_rad = RadFromDeg(message.azimuth_deg()),
              .elevation_rad = RadFromDeg(message.elevation_deg())};
  if (message.distance() != 0) {
    orbit.distance = message.distance();
  }
  if (message.fov_y_deg() != 0) {
    orbit.fov_y_rad = RadFromDeg(message.fov_y_deg());
  }
  return orbit;
}

v1::JobProgress MessageFromProgress(const Progress& progress) {
  v1::JobProgress message;
  message.set_stage(std::string(progress.stage));
  message.set_done(progress.done);
  message.set_total(progress.total);
  message.set_unit(std::string(progress.unit));
  return message;
}

absl::StatusOr<Tone> ToneFromMessage(const v1::Tone& message) {
  Tone tone{.exposure_stops = message.exposure_stops()};
  switch (message.curve()) {
    case v1::Tone::NONE:
      break;
    case v1::Tone::REINHARD:
      tone.curve = ToneCurve::kReinhard;
      break;
    case v1::Tone::FILMIC:
      tone.curve = ToneCurve::kFilmic;
      break;
    default:
      return absl::InvalidArgumentError(absl::StrCat("tone curve ", static_cast<int>(message.curve()),
                                                     ", expected NONE, REINHARD or FILMIC"));
  }
  if (message.white() != 0) {
    tone.white = message.white();
  }
  return tone;
}

}  // namespace tessera
