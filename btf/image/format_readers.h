// The readers behind OpenImage, one per format. Not for use outside this folder, except ExrFile (exr_file.h).
#pragma once

#include <memory>
#include <string>

#include <absl/status/statusor.h>

#include "btf/image/image_reader.h"

namespace tessera {

[[nodiscard]] absl::StatusOr<std::unique_ptr<ImageReader>> OpenPng(std::unique_ptr<ByteStream> stream,
                                                                   std::string name,
                                                                   const ImageReadOptions& options);
[[nodiscard]] absl::StatusOr<std::unique_ptr<ImageReader>> OpenJpeg(std::unique_ptr<ByteStream> stream,
                                                                    std::string name,
                                                                    const ImageReadOptions& options);
[[nodiscard]] absl::StatusOr<std::unique_ptr<ImageReader>> OpenRadiance(std::unique_ptr<ByteStream> stream,
                                                                        std::string name,
                                                                        const ImageReadOptions& options);

}  // namespace tessera
