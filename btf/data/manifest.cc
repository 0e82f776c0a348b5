#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>
#include <utility>

#include <absl/strings/str_cat.h>
#include <nlohmann/json.hpp>

#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"
#include "btf/data/layouts.h"

namespace tessera {

namespace {

constexpr uint64_t kMaxManifestBytes = uint64_t{16} << 20;
// The numbers of an image, in this order; all but the last are required.
constexpr std::array<const char*, 5> kNumberKeys = {"lightPolarDeg", "lightAzimuthDeg", "viewPolarDeg",
                                                    "viewAzimuthDeg", "scale"};
constexpr size_t kScale = 4;

struct ManifestImage {
  std::string file;
  std::array<double, 5> numbers = {0.0, 0.0, 0.0, 0.0, 1.0};
};

struct Manifest {
  std::vector<ManifestImage> images;
  std::optional<Transfer> transfer;
  Provenance provenance;
};

size_t NumberIndex(const std::string& key) {
  return static_cast<size_t>(std::find(kNumberKeys.begin(), kNumberKeys.end(), key) - kNumberKeys.begin());
}

absl::Status ParseJsonImage(const nlohmann::json& entry, const std::string& where, Manifest& manifest) {
  if (!entry.is_object()) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": not an object"));
  }
  ManifestImage image;
  size_t required = 0;
  for (const auto& [key, value] : entry.items()) {
    const size_t number = NumberIndex(key);
    if (key == "file" && value.is_string()) {
      image.file = value.get<std::string>();
    } else if (number < kNumberKeys.size() && value.is_number()) {
      image.numbers[number] = value.get<double>();
      required += number != kScale ? 1 : 0;
    } else {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": key '", key, "' is ",
                       key == "file" || number < kNumberKeys.size() ? "of the wrong type" : "unknown"));
    }
  }
  if (image.file.empty() || required != kScale) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": needs file, lightPolarDeg, lightAzimuthDeg, viewPolarDeg and viewAzimuthDeg"));
  }
  manifest.images.push_back(std::move(image));
  return absl::OkStatus();
}

absl::StatusOr<Manifest> ParseJson(const std::string& text, const std::string& name) {
  const nlohmann::json root = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!root.is_object() || !root.contains("images") || !root["images"].is_array()) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", root.is_discarded() ? "not JSON" : "no array 'images' at its top"));
  }
  Manifest manifest;
  for (const auto& [key, value] : root.items()) {
    if (key == "images") {
      continue;
    }
    if (!value.is_string()) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": key '", key, "' is not a text"));
    }
    if (key == "transfer") {
      TESSERA_ASSIGN_OR_RETURN(manifest.transfer, ParseTransfer(value.get<std::string>()));
    } else if (key == "source") {
      manifest.provenance.source = value.get<std::string>();
    } else if (key == "licence") {
      manifest.provenance.licence = value.get<std::string>();
    } else if (key == "citation") {
      manifest.provenance.citation = value.get<std::string>();
    } else {
      return absl::InvalidArgumentError(absl::StrCat(name, ": key '", key, "' is unknown"));
    }
  }
  for (size_t i = 0; i < root["images"].size(); ++i) {
    TESSERA_RETURN_IF_ERROR(ParseJsonImage(root["images"][i], absl::StrCat(name, ": image ", i), manifest));
  }
  return manifest;
}

// The fields of the CSV record at `position` (RFC 4180), which moves behind it.
absl::StatusOr<std::vector<std::string>> NextRecord(const std::string& text, size_t& position) {
  std::vector<std::string> fields(1);
  bool quoted = false;
  while (position < text.size()) {
    const char c = text[position++];
    if (quoted) {
      if (c != '"') {
        fields.back().push_back(c);
      } else if (position < text.size() && text[position] == '"') {
        fields.back().push_back('"');
        ++position;
      } else {
        quoted = false;
      }
    } else if (c == '"' && fields.back().empty()) {
      quoted = true;
    } else if (c == ',') {
      fields.emplace_back();
    } else if (c == '\n') {
      break;
    } else if (c != '\r') {
      fields.back().push_back(c);
    }
  }
  if (quoted) {
    return absl::InvalidArgumentError("quote is not closed");
  }
  return fields;
}

std::string Trimmed(const std::string& text) {
  const size_t begin = text.find_first_not_of(" \t");
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

absl::Status ParseCsvImage(const std::vector<std::string>& fields, const std::vector<size_t>& columns,
                           const std::string& where, Manifest& manifest) {
  if (fields.size() != columns.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": ", fields.size(), " fields, the first line has ", columns.size()));
  }
  ManifestImage image;
  for (size_t column = 0; column < columns.size(); ++column) {
    if (columns[column] == kNumberKeys.size()) {
      image.file = fields[column];
      continue;
    }
    const std::string number = Trimmed(fields[column]);
    if (columns[column] == kScale && number.empty()) {
      continue;
    }
    double& value = image.numbers[columns[column]];
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), value);
    if (error != std::errc() || end != number.data() + number.size()) {
      return absl::InvalidArgumentError(
          absl::StrCat(where, ": ", kNumberKeys[columns[column]], " '", number, "' is not a number"));
    }
  }
  if (image.file.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": no file"));
  }
  manifest.images.push_back(std::move(image));
  return absl::OkStatus();
}

absl::StatusOr<Manifest> ParseCsv(const std::string& text, const std::string& name) {
  size_t position = text.starts_with("\xef\xbb\xbf") ? 3 : 0;
  Manifest manifest;
  std::vector<size_t> columns;  // index into kNumberKeys, its size for the file
  for (size_t record = 1; position < text.size(); ++record) {
    const std::string where = absl::StrCat(name, ": record ", record);
    absl::StatusOr<std::vector<std::string>> fields = NextRecord(text, position);
    if (!fields.ok()) {
      return absl::InvalidArgumentError(absl::StrCat(where, ": ", fields.status().message()));
    }
    if (fields->size() == 1 && Trimmed(fields->front()).empty()) {
      continue;
    }
    if (!columns.empty()) {
      TESSERA_RETURN_IF_ERROR(ParseCsvImage(*fields, columns, where, manifest));
      continue;
    }
    std::array<int, kNumberKeys.size() + 1> seen{};
    for (const std::string& field : *fields) {
      const std::string key = Trimmed(field);
      const size_t number = NumberIndex(key);
      if (number == kNumberKeys.size() && key != "file") {
        return absl::InvalidArgumentError(absl::StrCat(where, ": column '", key, "' is unknown"));
      }
      ++seen[number];
      columns.push_back(number);
    }
    for (size_t key = 0; key < seen.size(); ++key) {
      if (seen[key] > 1 || (seen[key] == 0 && key != kScale)) {
        return absl::InvalidArgumentError(absl::StrCat(where, ": column '",
                                                       key < kNumberKeys.size() ? kNumberKeys[key] : "file",
                                                       "' is there ", seen[key], " times"));
      }
    }
  }
  return manifest;
}

absl::StatusOr<Manifest> ReadManifest(ByteStream& stream, const std::string& name) {
  absl::StatusOr<std::string> text = ReadAll(stream, kMaxManifestBytes);
  if (!text.ok()) {
    return absl::Status(text.status().code(), absl::StrCat(name, ": ", text.status().message()));
  }
  const size_t first = text->find_first_not_of(" \t\r\n");
  const bool json = first != std::string::npos && ((*text)[first] == '{' || (*text)[first] == '[');
  TESSERA_ASSIGN_OR_RETURN(Manifest manifest, json ? ParseJson(*text, name) : ParseCsv(*text, name));
  if (manifest.images.empty() || manifest.images.size() > kMaxFiles) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", manifest.images.size(), " images, expected 1 to ", kMaxFiles));
  }
  ErrorList faults;
  std::map<std::string_view, size_t> uses;
  for (const ManifestImage& image : manifest.images) {
    if (!IsInnerName(image.file)) {
      faults.Add(absl::StrCat("'", image.file, "' leaves the manifest's folder"));
    }
    if (++uses[image.file] == 2) {
      faults.Add(absl::StrCat("'", image.file, "' is named twice"));
    }
    if (!std::isfinite(image.numbers[kScale]) || image.numbers[kScale] <= 0.0) {
      faults.Add(absl::StrCat("'", image.file, "' has scale ", image.numbers[kScale], ", expected above 0"));
    }
  }
  if (!faults.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(name, ": ", faults.count(), " faults: ", faults.Text()));
  }
  return manifest;
}

// `folder` stands before the manifest's names to give those of `files`; empty or ending in '/'.
absl::StatusOr<ImageList> ListImages(Manifest manifest, std::shared_ptr<const FileSet> files,
                                     const std::string& folder) {
  ImageList list;
  list.transfer = manifest.transfer;
  list.provenance = std::move(manifest.provenance);
  std::vector<size_t> indices;
  ErrorList missing;
  bool scaled = false;
  for (ManifestImage& image : manifest.images) {
    const std::optional<size_t> index = files->Find(folder + image.file);
    if (!index) {
      missing.Add(image.file);
      continue;
    }
    indices.push_back(*index);
    scaled = scaled || image.numbers[kScale] != 1.0;
    list.scale.push_back(static_cast<float>(image.numbers[kScale]));
    list.samples.push_back(
        {std::move(image.file), {image.numbers[0], image.numbers[1]}, {image.numbers[2], image.numbers[3]}});
  }
  if (!missing.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(missing.count(), " of ", manifest.images.size(),
                                                   " files of the manifest are missing: ", missing.Text()));
  }
  if (!scaled) {
    list.scale.clear();
  }
  list.images = MakeFileImages(std::move(files), std::move(indices));
  return list;
}

}  // namespace

absl::StatusOr<std::optional<size_t>> FindManifest(const FileSet& files) {
  std::optional<size_t> found;
  for (size_t i = 0; i < files.files().size(); ++i) {
    const std::string& name = files.files()[i].name;
    const size_t slash = name.find('/');
    const std::string_view base =
        slash == std::string::npos ? std::string_view(name) : std::string_view(name).substr(slash + 1);
    if (base != "manifest.json" && base != "manifest.csv") {
      continue;
    }
    if (found) {
      return absl::InvalidArgumentError(
          absl::StrCat("several manifests: ", files.files()[*found].name, " and ", name));
    }
    found = i;
  }
  return found;
}

absl::StatusOr<ImageList> ListManifest(std::shared_ptr<const FileSet> files, size_t manifest) {
  const std::string& name = files->files()[manifest].name;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ByteStream> stream, files->Open(manifest));
  TESSERA_ASSIGN_OR_RETURN(Manifest parsed, ReadManifest(*stream, name));
  const size_t slash = name.rfind('/');
  const std::string folder = slash == std::string::npos ? "" : name.substr(0, slash + 1);
  return ListImages(std::move(parsed), std::move(files), folder);
}

absl::StatusOr<ImageList> ListManifestFile(const std::filesystem::path& manifest) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ByteStream> stream, OpenFileStream(manifest));
  TESSERA_ASSIGN_OR_RETURN(Manifest parsed, ReadManifest(*stream, manifest.string()));
  std::vector<std::string> names;
  for (const ManifestImage& image : parsed.images) {
    names.push_back(image.file);
  }
  const std::filesystem::path folder = manifest.has_parent_path() ? manifest.parent_path() : ".";
  TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<const FileSet> files, OpenFiles(folder, std::move(names)));
  return ListImages(std::move(parsed), std::move(files), "");
}

}  // namespace tessera
