#include "btf/data/import.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <new>
#include <system_error>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/file_error.h"
#include "btf/base/status_macros.h"
#include "btf/data/import_images.h"
#include "btf/data/layouts.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

constexpr std::array<std::pair<std::string_view, ImportLayout>, 4> kLayoutNames = {
    {{"auto", ImportLayout::kAuto},
     {"ubo2003", ImportLayout::kUbo2003},
     {"manifest", ImportLayout::kManifest},
     {"exr", ImportLayout::kExr}}};

enum class PathKind { kFolder, kZip, kExr, kOther };

absl::StatusOr<PathKind> Examine(const fs::path& path) {
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status)) {
    return FileError(error ? error.value() : ENOENT, "cannot open", path.string());
  }
  if (fs::is_directory(status)) {
    return PathKind::kFolder;
  }
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ByteStream> stream, OpenFileStream(path));
  std::array<std::byte, 4> head{};
  TESSERA_ASSIGN_OR_RETURN(const size_t count, stream->Read(head));
  const std::string_view magic(reinterpret_cast<const char*>(head.data()), count);
  if (magic == "PK\x03\x04" || magic == "PK\x05\x06") {
    return PathKind::kZip;
  }
  return magic == "\x76\x2f\x31\x01" ? PathKind::kExr : PathKind::kOther;
}

absl::Status LayoutMismatch(const fs::path& path, std::string_view reason) {
  return absl::InvalidArgumentError(
      absl::StrCat(path.string(), ": ", absl::string_view(reason.data(), reason.size())));
}

// The one OpenEXR file of a set, if there is exactly one.
std::optional<size_t> FindSingleExr(const FileSet& files) {
  std::optional<size_t> found;
  for (size_t i = 0; i < files.files().size(); ++i) {
    const std::string& name = files.files()[i].name;
    if (HasImageName(name)) {
      if (found || !HasExrName(name)) {
        return std::nullopt;
      }
      found = i;
    }
  }
  return found;
}

absl::StatusOr<ImageList> ListFiles(const fs::path& path, std::shared_ptr<const FileSet> files,
                                    ImportLayout layout, const ImageReadOptions& options) {
  if (layout == ImportLayout::kAuto || layout == ImportLayout::kManifest) {
    TESSERA_ASSIGN_OR_RETURN(const std::optional<size_t> manifest, FindManifest(*files));
    if (manifest) {
      return ListManifest(std::move(files), *manifest);
    }
    if (layout == ImportLayout::kManifest) {
      return LayoutMismatch(path, "no manifest.json or manifest.csv in it");
    }
  }
  if (layout == ImportLayout::kUbo2003 || (layout == ImportLayout::kAuto && LooksLikeUbo2003(*files))) {
    return ListUbo2003(std::move(files));
  }
  if (const std::optional<size_t> exr = FindSingleExr(*files)) {
    const std::string name = files->files()[*exr].name;
    return ListExr([files, index = *exr] { return files->Open(index); }, name, options);
  }
  return LayoutMismatch(path,
                        layout == ImportLayout::kExr
                            ? "not a multi-part OpenEXR file, nor does it hold exactly one"
                            : "no layout recognised: no manifest.json or manifest.csv, no images named like "
                              "UBO2003, no single OpenEXR file");
}

absl::StatusOr<ImageList> ListPath(const fs::path& path, ImportLayout layout,
                                   const ImageReadOptions& options) {
  TESSERA_ASSIGN_OR_RETURN(const PathKind kind, Examine(path));
  switch (kind) {
    case PathKind::kFolder: {
      TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<const FileSet> files, OpenFolder(path));
      return ListFiles(path, std::move(files), layout, options);
    }
    case PathKind::kZip: {
      TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<const FileSet> files, OpenZip(path));
      return ListFiles(path, std::move(files), layout, options);
    }
    case PathKind::kExr:
      if (layout == ImportLayout::kAuto || layout == ImportLayout::kExr) {
        return ListExr([path] { return OpenFileStream(path); }, path.string(), options);
      }
      return LayoutMismatch(path, "an OpenEXR file, not the layout asked for");
    case PathKind::kOther:
      break;
  }
  if (layout == ImportLayout::kAuto || layout == ImportLayout::kManifest) {
    return ListManifestFile(path);
  }
  return LayoutMismatch(path, "neither a folder nor a zip archive nor an OpenEXR file");
}

}  // namespace

absl::StatusOr<ImportLayout> ParseImportLayout(std::string_view text) {
  for (const auto& [name, layout] : kLayoutNames) {
    if (text == name) {
      return layout;
    }
  }
  return absl::InvalidArgumentError(absl::StrCat("layout '", absl::string_view(text.data(), text.size()),
                                                 "': expected auto, ubo2003, manifest or exr"));
}

absl::StatusOr<std::unique_ptr<BtfSource>> ImportBtf(const fs::path& path, const ImportOptions& options,
                                                     const RunContext& context) {
  if (options.memory_budget_bytes < kMinImportBudgetBytes) {
    return absl::InvalidArgumentError(absl::StrCat("memory budget of ", options.memory_budget_bytes,
                                                   " bytes, expected at least ", kMinImportBudgetBytes));
  }
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  ImportOptions settled = options;
  if (settled.spill_folder.empty()) {
    std::error_code error;
    settled.spill_folder = fs::temp_directory_path(error);
    if (error) {
      return FileError(error.value(), "cannot find the folder for temporary files", "TMPDIR");
    }
  }
  try {
    const ImageReadOptions read_options = ImportReadOptions(settled);
    TESSERA_ASSIGN_OR_RETURN(ImageList list, ListPath(path, options.layout, read_options));
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    return ImportImages(std::move(list), settled, context);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat(path.string(), ": out of memory"));
  } catch (const fs::filesystem_error& error) {
    return FileError(error.code().value(), "cannot read", path.string());
  }
}

}  // namespace tessera
