#include "btf/image/image_io.h"

#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/byte_stream.h"
#include "btf/image/image_reader.h"
#include "btf/image/sample_table.h"

namespace tessera {

namespace {

absl::StatusOr<Image> ReadAllRows(ImageReader& reader, const std::optional<Transfer>& transfer) {
  const ImageHeader& header = reader.header();
  const Transfer curve = transfer.value_or(DefaultTransfer(header.format));
  const SampleTable table(header.type, curve);
  const SampleTable alpha_table(header.type, Transfer::Linear());
  Image image(header.width, header.height, header.channels);
  const size_t row_samples = static_cast<size_t>(header.width) * header.channels;
  // Floats, so that the samples are aligned for every type.
  std::vector<float> buffer((RowBytes(header) + sizeof(float) - 1) / sizeof(float));
  const std::span<std::byte> row = std::as_writable_bytes(std::span(buffer)).first(RowBytes(header));
  std::vector<float> plain(header.channels == 4 ? row_samples : 0);
  for (int y = 0; y < header.height; ++y) {
    TESSERA_RETURN_IF_ERROR(reader.ReadRows(1, row));
    const std::span<float> linear(image.at(0, y), row_samples);
    table.Convert(row, linear);
    if (header.channels == 4) {
      alpha_table.Convert(row, plain);
      for (size_t i = 3; i < row_samples; i += 4) {
        linear[i] = plain[i];
      }
    }
  }
  return image;
}

absl::StatusOr<Image> ReadStream(std::unique_ptr<ByteStream> stream, std::string_view name,
                                 const std::optional<Transfer>& transfer) {
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ImageReader> reader,
                           OpenImage(std::move(stream), name, ImageReadOptions{}));
  return ReadAllRows(*reader, transfer);
}

}  // namespace

absl::StatusOr<Image> ReadImage(const std::filesystem::path& path, const std::optional<Transfer>& transfer) {
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<ByteStream> stream, OpenFileStream(path));
  return ReadStream(std::move(stream), path.string(), transfer);
}

absl::StatusOr<Image> DecodeImage(std::span<const std::byte> bytes, std::string_view name,
                                  const std::optional<Transfer>& transfer) {
  return ReadStream(MakeMemoryStream(bytes), name, transfer);
}

}  // namespace tessera
