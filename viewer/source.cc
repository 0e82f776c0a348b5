#include "viewer/source.h"

#include <algorithm>
#include <map>
#include <span>
#include <string_view>
#include <utility>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"
#include "btf/remesh/remesh.h"
#include "btf/remesh/triangle_mesh_io.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dress.h"
#include "btf/wang/mesh_io.h"
#include "btf/wang/shapes.h"
#include "client/lib/client.h"
#include "client/lib/names.h"

namespace tessera::viewer {
namespace {

constexpr std::string_view kBuiltinPrefix = "builtin:";

struct ReadMeshResult {
  QuadMesh mesh;
  uint32_t target_quads = 0;  // as DressParams
  std::string note;
};

absl::StatusOr<ReadMeshResult> RemeshFile(const std::string& path, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const TriangleMesh triangles, ReadTriangleMesh(path));
  TESSERA_ASSIGN_OR_RETURN(RemeshResult remeshed, RemeshTriangles(triangles, {}, context));
  ReadMeshResult result{.note = "not of quads, so it was remeshed"};
  for (const std::string& warning : remeshed.report.Warnings()) {
    absl::StrAppend(&result.note, "; ", warning);
  }
  result.target_quads = static_cast<uint32_t>(remeshed.mesh.quads.size());
  result.mesh = std::move(remeshed.mesh);
  return result;
}

absl::StatusOr<ReadMeshResult> ReadMeshOrShape(const std::string& mesh, const RunContext& context) {
  ReadMeshResult result;
  if (mesh.starts_with(kBuiltinPrefix)) {
    TESSERA_ASSIGN_OR_RETURN(result.mesh, BuiltinShape(mesh.substr(kBuiltinPrefix.size())));
    return result;
  }
  const std::string extension = MeshExtension(mesh);
  if (extension == ".ply" || extension == ".gltf" || extension == ".glb") {
    return RemeshFile(mesh, context);
  }
  MeshReadNotes notes;
  absl::StatusOr<QuadMesh> quads = ReadQuadMesh(mesh, &notes);
  if (!quads.ok() && notes.faces_not_quads > 0) {
    return RemeshFile(mesh, context);
  }
  TESSERA_ASSIGN_OR_RETURN(result.mesh, std::move(quads));
  return result;
}

absl::StatusOr<Surface> DressNow(const SurfaceChoice& choice, const RunContext& context) {
  TESSERA_ASSIGN_OR_RETURN(const Arrangement* arrangement, FindArrangement(choice.arrangement));
  TESSERA_ASSIGN_OR_RETURN(ReadMeshResult read, ReadMeshOrShape(choice.mesh, context));
  // A picture shows breaks rather than refusing them.
  TESSERA_ASSIGN_OR_RETURN(
      DressResult dressed,
      DressMesh(read.mesh, *arrangement, {.allow_breaks = true, .target_quads = read.target_quads}, context));
  if (!dressed.breaks.empty()) {
    absl::StrAppend(&read.note, read.note.empty() ? "" : "; ", "the frame of ", arrangement->id,
                    " breaks at ", dressed.breaks.size(), " edges, where tiles do not match");
  }
  return Surface{std::make_shared<const Dressing>(std::move(dressed.dressing)), std::move(read.note)};
}

absl::StatusOr<Surface> ReadDressing(const std::string& path) {
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes, ReadWholeFile(path));
  TESSERA_ASSIGN_OR_RETURN(Dressing dressing, ParseDressing(std::as_bytes(std::span(bytes))));
  return Surface{std::make_shared<const Dressing>(std::move(dressing)), ""};
}

std::optional<double> NumberAt(const nlohmann::json& json, const char* pointer) {
  const nlohmann::json::json_pointer at(pointer);
  if (!json.is_object() || !json.contains(at) || !json.at(at).is_number()) {
    return std::nullopt;
  }
  return json.at(at).get<double>();
}

std::string OriginOf(const v1::Provenance& provenance) {
  std::string text;
  for (const std::string* part : {&provenance.source(), &provenance.licence(), &provenance.citation()}) {
    if (!part->empty()) {
      absl::StrAppend(&text, text.empty() ? "" : "; ", *part);
    }
  }
  return text;
}

nlohmann::json ParsedOrNull(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  return json.is_discarded() ? nlohmann::json() : json;
}

// Errors of materials, by digest.
using CodecErrors = std::map<std::string, double>;

CodecErrors CodecErrorsOf(const std::vector<v1::Material>& materials) {
  CodecErrors errors;
  for (const v1::Material& material : materials) {
    if (const auto rmse = NumberAt(ParsedOrNull(material.metadata_json()), "/diagnosis/rmse")) {
      errors[material.blob().sha256()] = *rmse;
    }
  }
  return errors;
}

std::optional<double> ErrorOfMaterial(const nlohmann::json& metadata, const CodecErrors& errors) {
  const auto sha256 = metadata.is_object() ? metadata.find("material_sha256") : metadata.end();
  if (sha256 == metadata.end() || !sha256->is_string()) {
    return std::nullopt;
  }
  const auto found = errors.find(sha256->get<std::string>());
  return found == errors.end() ? std::nullopt : std::optional(found->second);
}

std::vector<std::string> WarningsOf(const nlohmann::json& metadata) {
  std::vector<std::string> warnings;
  if (metadata.is_object() && metadata.contains("warnings")) {
    for (const nlohmann::json& warning : metadata["warnings"]) {
      if (warning.is_string()) {
        warnings.push_back(warning.get<std::string>());
      }
    }
  }
  return warnings;
}

TileSetEntry EntryOf(const v1::TileSet& tile_set, const CodecErrors& errors) {
  const nlohmann::json certificate = ParsedOrNull(tile_set.certificate_json());
  const nlohmann::json metadata = ParsedOrNull(tile_set.metadata_json());
  return {.name = ShortName(tile_set.name()),
          .sha256 = tile_set.blob().sha256(),
          .size_bytes = tile_set.blob().size_bytes(),
          .codec = tile_set.codec(),
          .tile_size = tile_set.tile_size(),
          .num_tiles = tile_set.num_tiles(),
          .num_btfels = tile_set.num_btfels(),
          .origin = OriginOf(tile_set.provenance()),
          .seam_ratio_borders = NumberAt(certificate, "/borders/ratio"),
          .seam_ratio_insides = NumberAt(certificate, "/insides/ratio"),
          .codec_error = ErrorOfMaterial(metadata, errors),
          .warnings = WarningsOf(metadata),
          .thumbnail_sha256 = tile_set.thumbnail().sha256(),
          .thumbnail_bytes = tile_set.thumbnail().size_bytes()};
}

class ServerSource final : public Source {
 public:
  explicit ServerSource(std::string address) : address_(std::move(address)) {}

  absl::StatusOr<Surface> Open(const SurfaceChoice& choice, const RunContext& context) override {
    return choice.dressing.empty() ? DressNow(choice, context) : ReadDressing(choice.dressing);
  }

  absl::StatusOr<std::vector<TileSetEntry>> List(const std::string& arrangement,
                                                 const RunContext& context) override {
    TESSERA_ASSIGN_OR_RETURN(const std::string parent, FullArrangementName(arrangement));
    TESSERA_RETURN_IF_ERROR(Connect(context));
    TESSERA_ASSIGN_OR_RETURN(const std::vector<v1::TileSet> listed, client_->ListTileSets(parent, context));
    // Only for a figure: without it the list is worth showing all the same.
    const absl::StatusOr<std::vector<v1::Material>> materials = client_->ListMaterials(context);
    const CodecErrors errors = materials.ok() ? CodecErrorsOf(*materials) : CodecErrors{};
    std::vector<TileSetEntry> entries;
    for (const v1::TileSet& tile_set : listed) {
      entries.push_back(EntryOf(tile_set, errors));
    }
    std::sort(entries.begin(), entries.end(),
              [](const TileSetEntry& a, const TileSetEntry& b) { return a.name < b.name; });
    return entries;
  }

  absl::StatusOr<std::shared_ptr<const TileSet>> Fetch(const std::string& name,
                                                       const RunContext& context) override {
    TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullTileSetName(name));
    TESSERA_RETURN_IF_ERROR(Connect(context));
    TESSERA_ASSIGN_OR_RETURN(TileSet tile_set, client_->FetchTileSet(full_name, context));
    return std::make_shared<const TileSet>(std::move(tile_set));
  }

  absl::StatusOr<Pixels> FetchThumbnail(const TileSetEntry& entry, const RunContext& context) override {
    TESSERA_RETURN_IF_ERROR(Connect(context));
    v1::Blob blob;
    blob.set_sha256(entry.thumbnail_sha256);
    blob.set_size_bytes(entry.thumbnail_bytes);
    TESSERA_ASSIGN_OR_RETURN(const std::string bytes, client_->FetchBlob(blob, context));
    TESSERA_ASSIGN_OR_RETURN(const Image picture,
                             DecodeImage(std::as_bytes(std::span(bytes)), entry.name + ".png", std::nullopt));
    if (std::max(picture.width, picture.height) > kMostThumbnailSide) {
      return absl::InvalidArgumentError(absl::StrCat("thumbnail of ", entry.name, ": ", picture.width, "x",
                                                     picture.height, ", at most ", kMostThumbnailSide));
    }
    return PixelsOf(picture);
  }

 private:
  // Few attempts: whoever looks at the window can ask again.
  static constexpr int kMaxAttempts = 3;

  absl::Status Connect(const RunContext& context) {
    if (client_ != nullptr) {
      return absl::OkStatus();
    }
    TESSERA_ASSIGN_OR_RETURN(
        client_, Client::Connect({.address = address_, .retry = {.max_attempts = kMaxAttempts}}, context));
    return absl::OkStatus();
  }

  const std::string address_;
  std::unique_ptr<Client> client_;
};

}  // namespace

std::unique_ptr<Source> MakeServerSource(std::string address) {
  return std::make_unique<ServerSource>(std::move(address));
}

}  // namespace tessera::viewer
