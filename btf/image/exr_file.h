// OpenEXR files with one or many parts. Every call of the library is wrapped: nothing throws.
//
//   TESSERA_ASSIGN_OR_RETURN(auto file, ExrFile::Open(std::move(stream), "btf.exr", options));
//   std::optional<double> theta = file->FloatAttribute(0, "lightPolarDeg");
//   TESSERA_ASSIGN_OR_RETURN(auto reader, file->OpenPart(0));
//
// Source: "Technical Introduction to OpenEXR", openexr.com; rows are delivered by increasing y.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include <absl/status/statusor.h>

#include "btf/image/image_reader.h"

namespace tessera {

// Not thread-safe: open the file once per thread.
class ExrFile {
 public:
  // A stream that cannot seek is read into memory first, within options.memory_limit_bytes.
  // Errors: INVALID_ARGUMENT (not OpenEXR), DATA_LOSS (damaged headers), RESOURCE_EXHAUSTED.
  [[nodiscard]] static absl::StatusOr<std::shared_ptr<ExrFile>> Open(std::unique_ptr<ByteStream> stream,
                                                                     std::string name,
                                                                     const ImageReadOptions& options);
  virtual ~ExrFile() = default;

  [[nodiscard]] virtual int num_parts() const = 0;
  // The part's name attribute, empty without one.
  [[nodiscard]] virtual std::string PartName(int part) const = 0;
  // The value of a float or double attribute, nothing if there is none of that name and type.
  [[nodiscard]] virtual std::optional<double> FloatAttribute(int part, std::string_view attribute) const = 0;

  // The reader keeps the file alive. Errors as for OpenImage; messages begin with the file's name, and the
  // part's if there are several.
  [[nodiscard]] virtual absl::StatusOr<std::unique_ptr<ImageReader>> OpenPart(int part) = 0;
  // Bytes that the library holds for parts opened so far: it keeps their buffers until the file is closed.
  [[nodiscard]] virtual uint64_t retained_bytes() const = 0;
};

}  // namespace tessera
