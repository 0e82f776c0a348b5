// The layouts a BTF can be imported from. Each turns names, a manifest or attributes into the same list of
// images with their angles; how a list becomes a BTF is in import.cc.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/data/btf_source.h"
#include "btf/data/file_set.h"
#include "btf/data/sample_grid.h"
#include "btf/image/image_reader.h"
#include "btf/image/transfer.h"

namespace tessera {

// The images of one BTF, wherever they lie.
class ImageSet {
 public:
  virtual ~ImageSet() = default;

  // Opens image `index` of ImageList::samples and hands it to `use`. Thread-safe. Errors: those of OpenImage
  // and of `use`.
  [[nodiscard]] virtual absl::Status WithReader(
      size_t index, const ImageReadOptions& options,
      const std::function<absl::Status(ImageReader&)>& use) const = 0;
  // Bytes that each open image needs beside ImageReader::working_bytes(), known before any is opened.
  [[nodiscard]] virtual uint64_t open_bytes() const = 0;
};

struct ImageList {
  std::vector<SampleAngles> samples;
  std::vector<float> scale;  // per sample, empty: all 1
  std::unique_ptr<ImageSet> images;
  std::optional<Transfer> transfer;  // as the manifest says
  Provenance provenance;             // likewise
};

// Directions in file names: ".../tvTTT_pvPPP/NNNNN tlTTT plPPP tvTTT pvPPP.jpg", degrees, t polar, p azimuth,
// l light, v view; folders above and the number are free. Only JPEG, PNG and EXR files are looked at. Errors:
// INVALID_ARGUMENT naming images in tvTTT_pvPPP folders that are not so named or disagree with the folder.
[[nodiscard]] absl::StatusOr<ImageList> ListUbo2003(std::shared_ptr<const FileSet> files);
// Whether any file is named so.
[[nodiscard]] bool LooksLikeUbo2003(const FileSet& files);

// "manifest.json" or "manifest.csv" in the topmost folder or in a single folder below it. Errors:
// INVALID_ARGUMENT when there are several.
[[nodiscard]] absl::StatusOr<std::optional<size_t>> FindManifest(const FileSet& files);
// README.md describes the format. File names are relative to the manifest.
// Errors: INVALID_ARGUMENT naming the line, key, or file; RESOURCE_EXHAUSTED (size).
[[nodiscard]] absl::StatusOr<ImageList> ListManifest(std::shared_ptr<const FileSet> files, size_t manifest);
[[nodiscard]] absl::StatusOr<ImageList> ListManifestFile(const std::filesystem::path& manifest);

// One OpenEXR file whose parts carry lightPolarDeg, lightAzimuthDeg, viewPolarDeg and viewAzimuthDeg.
// `open` makes streams of the file, thread-safe. Errors: INVALID_ARGUMENT naming parts without them.
[[nodiscard]] absl::StatusOr<ImageList> ListExr(
    std::function<absl::StatusOr<std::unique_ptr<ByteStream>>()> open, const std::string& name,
    const ImageReadOptions& options);

// Images that are files of a set: files[i] is the index in `set` of image i.
[[nodiscard]] std::unique_ptr<ImageSet> MakeFileImages(std::shared_ptr<const FileSet> set,
                                                       std::vector<size_t> files);

// By the ending of the name, in any case: .jpg .jpeg .png .exr.
[[nodiscard]] bool HasImageName(std::string_view name);
[[nodiscard]] bool HasExrName(std::string_view name);

}  // namespace tessera
