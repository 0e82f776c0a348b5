// Measured BTFs from files: the UBO2003 layout, a manifest with images, one multi-part EXR.
//
//   ImportOptions options;
//   options.transfer = ParseTransfer("gamma:2.2").value();
//   TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<BtfSource> source, ImportBtf("WOOL128.zip", options, context));
//   TESSERA_ASSIGN_OR_RETURN(Material wool, codec->Encode(*source, {}, context));
//
// Layouts, file names, manifest keys and the conversions each importer makes are described in README.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/image/transfer.h"

namespace tessera {

enum class ImportLayout { kAuto, kUbo2003, kManifest, kExr };

// "auto", "ubo2003", "manifest" or "exr". Errors: INVALID_ARGUMENT naming the text and the legal forms.
[[nodiscard]] absl::StatusOr<ImportLayout> ParseImportLayout(std::string_view text);

// The least memory an import works with.
inline constexpr uint64_t kMinImportBudgetBytes = uint64_t{4} << 20;

struct ImportOptions {
  ImportLayout layout = ImportLayout::kAuto;
  // For every image; none: srgb for JPEG and PNG, linear for EXR.
  std::optional<Transfer> transfer;
  // Upper bound on what the importer and the source it returns allocate for samples, at least
  // kMinImportBudgetBytes. The BTF may be larger: it is then kept in a temporary file.
  uint64_t memory_budget_bytes = uint64_t{512} << 20;
  // Where that file lies; empty: the system's folder for temporary files.
  std::filesystem::path spill_folder;
  Provenance provenance;
};

// Reads every image once, in parallel, and returns the BTF as rows of texels. `path` is a folder, a zip
// archive, a manifest or a multi-part EXR. Views and lights come in order of polar angle, then azimuth. The
// same samples for any number of threads and any budget.
//
// A BTF larger than a quarter of the budget lives in a spill file of W x H x 3 x views x lights codes of the
// images' own width (8-bit images: one byte). Its space is reserved before the first image is decoded; the
// file has no name, so it is gone with the source, after an error, a cancel or a kill.
//
// Progress: stages "check" (headers) and "images", unit "images". Cancels within one scanline per thread.
//
// Errors: INVALID_ARGUMENT (budget, layout not recognised, missing, duplicate, differently sized images,
// unknown names, values that are not finite), DATA_LOSS (truncated or damaged), NOT_FOUND, PERMISSION_DENIED,
// RESOURCE_EXHAUSTED (limits on archives and images, no space for the spill file), INTERNAL (read or write
// failed), CANCELLED. Messages name the first few of the images concerned, and how many there are.
[[nodiscard]] absl::StatusOr<std::unique_ptr<BtfSource>> ImportBtf(const std::filesystem::path& path,
                                                                   const ImportOptions& options,
                                                                   const RunContext& context);

}  // namespace tessera
