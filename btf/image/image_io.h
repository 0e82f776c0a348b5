// Whole images from and to files and bytes: PNG, JPEG, OpenEXR, and from Radiance's (.hdr, .pic).
//
//   TESSERA_ASSIGN_OR_RETURN(Image height, ReadImage("height.png", Transfer::Linear()));
//   TESSERA_ASSIGN_OR_RETURN(std::string png, EncodePng(picture));
//   TESSERA_RETURN_IF_ERROR(WriteFileAtomically("picture.png", png));
//
// Formats are told apart by their first bytes, never by name. What is read: PNG gray, RGB, palette, with or
// without alpha, up to 16 bits; JPEG gray and YCbCr/RGB, 8 bits; EXR scanline or tiled, half, float or uint,
// channels R G B, or Y, and A; Radiance RGBE, plain or run-length encoded either way, top row first, as
// mantissa times 2^(exponent - 136) over the file's EXPOSURE and COLORCORR. Not read, by name: CMYK JPEG,
// deep or luminance-chroma EXR, Radiance XYZE or turned. Colour profiles in files are ignored: the transfer
// curve is an argument. At most kMaxImageSide on a side.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/image/image.h"
#include "btf/image/transfer.h"

namespace tessera {

inline constexpr int kMaxImageSide = 16384;

// Linear image with the file's number of channels (1, 3, or 4 with alpha, which no transfer curve touches;
// gray with alpha becomes 4). Without a transfer curve: srgb for PNG and JPEG, linear for EXR and
// Radiance.
// Errors: NOT_FOUND, PERMISSION_DENIED, INVALID_ARGUMENT (not such an image, size beyond the limit, kinds not
// read), DATA_LOSS (truncated or damaged), RESOURCE_EXHAUSTED (memory). Every message begins with the name.
[[nodiscard]] absl::StatusOr<Image> ReadImage(const std::filesystem::path& path,
                                              const std::optional<Transfer>& transfer);
[[nodiscard]] absl::StatusOr<Image> DecodeImage(std::span<const std::byte> bytes, std::string_view name,
                                                const std::optional<Transfer>& transfer);

// PNG, 8 bits, sRGB, rounded to nearest, values clamped to [0, 1] (not-a-number becomes 0); gray, RGB or RGBA
// like the image. Errors: INVALID_ARGUMENT (shape).
[[nodiscard]] absl::StatusOr<std::string> EncodePng(const Image& image);

enum class ExrDepth { kHalf, kFloat };
// Linear OpenEXR, ZIP-compressed scanlines, channels Y, RGB or RGBA. Errors: INVALID_ARGUMENT (shape).
[[nodiscard]] absl::StatusOr<std::string> EncodeExr(const Image& image, ExrDepth depth = ExrDepth::kHalf);

}  // namespace tessera
