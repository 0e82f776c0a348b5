#include "btf/image/exr_file.h"

#include <algorithm>
#include <array>
#include <exception>
#include <utility>

#include <OpenEXR/IexBaseExc.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfDoubleAttribute.h>
#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfPartType.h>
#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"

namespace tessera {

namespace {

// Throws, as OpenEXR wants it: only ever called from inside the library.
class ExrStream : public Imf::IStream {
 public:
  ExrStream(std::unique_ptr<ByteStream> stream, const std::string& name)
      : IStream(name.c_str()), stream_(std::move(stream)) {}

  bool read(char bytes[], int count) override {
    const absl::StatusOr<size_t> read =
        stream_->Read(std::as_writable_bytes(std::span(bytes, static_cast<size_t>(count))));
    if (!read.ok()) {
      throw Iex::IoExc(std::string(read.status().message()));
    }
    position_ += *read;
    if (*read < static_cast<size_t>(count)) {
      throw Iex::InputExc("unexpected end of file");
    }
    return position_ < stream_->size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override {
    if (!stream_->Seek(position).ok()) {
      throw Iex::InputExc("unexpected end of file");
    }
    position_ = position;
  }

 private:
  std::unique_ptr<ByteStream> stream_;
  uint64_t position_ = 0;
};

// The status of whatever `call` throws, OK if it returns.
template <typename Call>
absl::Status Guarded(const std::string& name, const Call& call) {
  try {
    call();
    return absl::OkStatus();
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat(name, ": out of memory"));
  } catch (const std::exception& error) {
    return absl::DataLossError(absl::StrCat(name, ": truncated or damaged OpenEXR: ", error.what()));
  }
}

int LinesPerChunk(Imf::Compression compression) {
  switch (compression) {
    case Imf::NO_COMPRESSION:
    case Imf::RLE_COMPRESSION:
    case Imf::ZIPS_COMPRESSION:
      return 1;
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 32;
  }
}

// What the library allocates for one part: its line or tile buffers and compressor (about three of them), and
// its table of chunk offsets.
uint64_t PartBytes(const Imf::Header& header, uint64_t width, uint64_t height) {
  uint64_t pixel_bytes = 0;
  for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
    pixel_bytes += channel.channel().type == Imf::HALF ? 2 : 4;
  }
  if (header.hasTileDescription()) {
    const Imf::TileDescription& tiles = header.tileDescription();
    const uint64_t tile_pixels = uint64_t{tiles.xSize} * tiles.ySize;
    const uint64_t cached_pixels = (width + tiles.xSize) * tiles.ySize;  // a row of tiles
    const uint64_t num_tiles =
        (width / std::max(1u, tiles.xSize) + 1) * (height / std::max(1u, tiles.ySize) + 1);
    return (3 * tile_pixels + cached_pixels) * pixel_bytes + 16 * num_tiles;
  }
  const uint64_t lines = std::min<uint64_t>(height, LinesPerChunk(header.compression()));
  return 3 * lines * width * pixel_bytes + 16 * height;
}

class ExrPartReader : public ImageReader {
 public:
  explicit ExrPartReader(std::string name) : ImageReader(std::move(name)) {}

  absl::Status Open(std::shared_ptr<void> file, Imf::MultiPartInputFile& input, int part,
                    const ImageReadOptions& options) {
    file_ = std::move(file);
    const Imf::Header& header = input.header(part);
    if (header.hasType() && !Imf::isSupportedType(header.type())) {
      return absl::InvalidArgumentError(absl::StrCat(name_, ": OpenEXR of type ", header.type()));
    }
    if (header.hasType() && Imf::isDeepData(header.type())) {
      return absl::InvalidArgumentError(absl::StrCat(name_, ": deep OpenEXR is not read"));
    }
    const Imath::Box2i& window = header.dataWindow();
    const int64_t width = int64_t{window.max.x} - window.min.x + 1;
    const int64_t height = int64_t{window.max.y} - window.min.y + 1;
    working_bytes_ = PartBytes(header, static_cast<uint64_t>(std::max<int64_t>(width, 0)),
                               static_cast<uint64_t>(std::max<int64_t>(height, 0)));
    TESSERA_RETURN_IF_ERROR(CheckLimits(width, height, options));
    min_x_ = window.min.x;
    min_y_ = window.min.y;
    header_.format = ImageFormat::kExr;
    header_.width = static_cast<int>(width);
    header_.height = static_cast<int>(height);
    TESSERA_RETURN_IF_ERROR(ChooseChannels(header.channels(), options.alpha));
    return Guarded(name_, [&] { part_.emplace(input, part); });
  }

 private:
  absl::Status ChooseChannels(const Imf::ChannelList& channels, AlphaUse alpha) {
    if (channels.findChannel("RY") != nullptr || channels.findChannel("BY") != nullptr) {
      return absl::InvalidArgumentError(absl::StrCat(name_, ": luminance-chroma OpenEXR is not read"));
    }
    const bool rgb = channels.findChannel("R") != nullptr && channels.findChannel("G") != nullptr &&
                     channels.findChannel("B") != nullptr;
    gray_ = !rgb && channels.findChannel("Y") != nullptr;
    if (!rgb && !gray_) {
      return absl::InvalidArgumentError(absl::StrCat(name_, ": OpenEXR without channels R, G, B or Y"));
    }
    const bool has_alpha = alpha == AlphaUse::kKeep && channels.findChannel("A") != nullptr;
    header_.channels = has_alpha ? 4 : gray_ ? 1 : 3;
    if (gray_) {
      sources_.emplace_back("Y", 0);
    } else {
      sources_.assign({{"R", 0}, {"G", 1}, {"B", 2}});
    }
    if (has_alpha) {
      sources_.emplace_back("A", 3);
    }
    header_.type = SampleType::kHalf;
    for (const auto& [source, index] : sources_) {
      const Imf::Channel& channel = *channels.findChannel(source);
      if (channel.xSampling != 1 || channel.ySampling != 1) {
        return absl::InvalidArgumentError(
            absl::StrCat(name_, ": OpenEXR channel ", source, " is subsampled"));
      }
      if (channel.type != Imf::HALF) {
        header_.type = SampleType::kFloat;
      }
    }
    return absl::OkStatus();
  }

  absl::Status ReadNextRows(int num_rows, std::span<std::byte> rows) override {
    if (num_rows == 0) {
      return absl::OkStatus();
    }
    const size_t sample_bytes = SampleBytes(header_.type);
    const size_t pixel_bytes = sample_bytes * header_.channels;
    TESSERA_RETURN_IF_ERROR(Guarded(name_, [&] {
      const int y_begin = min_y_ + next_row_;
      Imf::FrameBuffer frame;
      for (const auto& [source, index] : sources_) {
        // OpenEXR addresses a sample as base + x * xStride + y * yStride, x and y in its own pixel space.
        const ptrdiff_t offset = static_cast<ptrdiff_t>(index * sample_bytes) -
                                 static_cast<ptrdiff_t>(min_x_) * static_cast<ptrdiff_t>(pixel_bytes) -
                                 static_cast<ptrdiff_t>(y_begin) * static_cast<ptrdiff_t>(RowBytes(header_));
        const auto address = reinterpret_cast<uintptr_t>(rows.data()) + static_cast<uintptr_t>(offset);
        frame.insert(source, Imf::Slice(header_.type == SampleType::kHalf ? Imf::HALF : Imf::FLOAT,
                                        reinterpret_cast<char*>(address), pixel_bytes, RowBytes(header_)));
      }
      part_->setFrameBuffer(frame);
      part_->readPixels(y_begin, y_begin + num_rows - 1);
    }));
    if (gray_ && header_.channels == 4) {
      for (size_t pixel = 0; pixel < rows.size(); pixel += pixel_bytes) {
        std::copy_n(rows.begin() + pixel, sample_bytes, rows.begin() + pixel + sample_bytes);
        std::copy_n(rows.begin() + pixel, sample_bytes, rows.begin() + pixel + 2 * sample_bytes);
      }
    }
    return absl::OkStatus();
  }

  std::shared_ptr<void> file_;  // keeps the file open that part_ reads from
  std::optional<Imf::InputPart> part_;
  int min_x_ = 0;
  int min_y_ = 0;
  bool gray_ = false;
  std::vector<std::pair<const char*, size_t>> sources_;  // OpenEXR channel and index in a pixel
};

class ExrFileImpl : public ExrFile, public std::enable_shared_from_this<ExrFileImpl> {
 public:
  ExrFileImpl(std::unique_ptr<ByteStream> stream, std::string name, const ImageReadOptions& options)
      : name_(std::move(name)), options_(options), stream_(std::move(stream), name_) {}

  absl::Status Open() {
    return Guarded(name_, [&] { input_.emplace(stream_, /*numThreads=*/0); });
  }

  [[nodiscard]] int num_parts() const override { return input_->parts(); }

  [[nodiscard]] std::string PartName(int part) const override {
    const Imf::Header& header = input_->header(part);
    return header.hasName() ? header.name() : std::string();
  }

  [[nodiscard]] std::optional<double> FloatAttribute(int part, std::string_view attribute) const override {
    const Imf::Header& header = input_->header(part);
    const std::string key(attribute);
    if (const auto* value = header.findTypedAttribute<Imf::FloatAttribute>(key)) {
      return value->value();
    }
    if (const auto* value = header.findTypedAttribute<Imf::DoubleAttribute>(key)) {
      return value->value();
    }
    return std::nullopt;
  }

  [[nodiscard]] absl::StatusOr<std::unique_ptr<ImageReader>> OpenPart(int part) override {
    if (part < 0 || part >= num_parts()) {
      return absl::InvalidArgumentError(absl::StrCat(name_, ": part ", part, " of ", num_parts()));
    }
    const std::string part_name = PartName(part);
    auto reader = std::make_unique<ExrPartReader>(
        num_parts() == 1 ? name_
                         : absl::StrCat(name_, ": part ", part, part_name.empty() ? "" : " ", part_name));
    TESSERA_RETURN_IF_ERROR(reader->Open(shared_from_this(), *input_, part, options_));
    retained_bytes_ += reader->working_bytes();
    return reader;
  }

  [[nodiscard]] uint64_t retained_bytes() const override { return retained_bytes_; }

 private:
  std::string name_;
  ImageReadOptions options_;
  ExrStream stream_;
  std::optional<Imf::MultiPartInputFile> input_;
  uint64_t retained_bytes_ = 0;
};

}  // namespace

absl::StatusOr<std::shared_ptr<ExrFile>> ExrFile::Open(std::unique_ptr<ByteStream> stream, std::string name,
                                                       const ImageReadOptions& options) {
  if (!stream->seekable()) {
    absl::StatusOr<std::string> bytes = ReadAll(*stream, options.memory_limit_bytes);
    if (!bytes.ok()) {
      return absl::Status(bytes.status().code(),
                          absl::StrCat(name, ": compressed OpenEXR: ", bytes.status().message()));
    }
    stream = MakeMemoryStream(*std::move(bytes));
  }
  auto file = std::make_shared<ExrFileImpl>(std::move(stream), std::move(name), options);
  TESSERA_RETURN_IF_ERROR(file->Open());
  return file;
}

}  // namespace tessera
