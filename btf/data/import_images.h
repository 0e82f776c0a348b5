// From a list of images with angles to a BTF: the part of an import that all layouts share.
#pragma once

#include <memory>

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/data/import.h"
#include "btf/data/layouts.h"

namespace tessera {

// How readers are opened: no alpha, and all open at a time within a quarter of the budget.
[[nodiscard]] ImageReadOptions ImportReadOptions(const ImportOptions& options);

// Checks that the images make a full product of views and lights and that their headers agree, then decodes
// each once. options.spill_folder must be set. Errors: as for ImportBtf.
[[nodiscard]] absl::StatusOr<std::unique_ptr<BtfSource>> ImportImages(ImageList list,
                                                                      const ImportOptions& options,
                                                                      const RunContext& context);

}  // namespace tessera
