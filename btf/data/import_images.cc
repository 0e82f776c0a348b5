#include "btf/data/import_images.h"

#include <algorithm>
#include <functional>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"
#include "btf/data/transposed_samples.h"

namespace tessera {

namespace {

// Shares of the budget: decoding and samples kept in memory are never both at their limit, see PlanStorage.
constexpr uint64_t kReaderShare = 4;    // one part in four for what open readers need
constexpr uint64_t kMemoryShare = 4;    // a BTF within this share stays in memory
constexpr uint64_t kBatchShare = 4;     // decoded images waiting to be transposed
constexpr uint64_t kTransferShare = 8;  // buffers of transposition and of ReadRows

// Counts finished images and reports them, one call at a time.
class ImageProgress {
 public:
  ImageProgress(const RunContext& context, std::string_view stage, size_t total)
      : context_(context), stage_(stage), total_(total) {
    context_.Report(stage_, 0, total_, "images");
  }
  void Advance() {
    const std::lock_guard lock(mutex_);
    ++done_;
    context_.Report(stage_, done_, total_, "images");
  }

 private:
  const RunContext& context_;
  std::string_view stage_;
  size_t total_;
  std::mutex mutex_;
  size_t done_ = 0;  // guarded by mutex_
};

// The faults of images by index, named in that order whichever thread met them first.
absl::Status Summarise(std::span<const absl::Status> statuses, std::string_view what) {
  ErrorList faults;
  absl::StatusCode code = absl::StatusCode::kOk;
  for (const absl::Status& status : statuses) {
    if (!status.ok()) {
      code = faults.empty() ? status.code() : code;
      faults.Add(std::string(status.message()));
    }
  }
  return faults.empty() ? absl::OkStatus()
                        : absl::Status(code, absl::StrCat(faults.count(), " of ", statuses.size(), " images ",
                                                          absl::string_view(what.data(), what.size()), ": ",
                                                          faults.Text()));
}

class ImageImport {
 public:
  ImageImport(ImageList list, const ImportOptions& options, const RunContext& context)
      : list_(std::move(list)),
        options_(options),
        read_options_(ImportReadOptions(options)),
        context_(context) {}

  absl::StatusOr<std::unique_ptr<BtfSource>> Run() {
    TESSERA_ASSIGN_OR_RETURN(grid_, BuildSampleGrid(list_.samples));
    TESSERA_RETURN_IF_ERROR(CheckHeaders());
    ChooseSamples();
    TESSERA_RETURN_IF_ERROR(PlanStorage());
    TESSERA_RETURN_IF_ERROR(whole_images_ ? DecodeInBatches() : DecodeInBands());
    return MakeTransposedBtf(Info(), layout_, SampleTable(type_, stored_transfer_), PairScale(),
                             std::move(storage_), options_.memory_budget_bytes / kTransferShare);
  }

 private:
  [[nodiscard]] size_t num_pairs() const { return grid_.image.size(); }
  [[nodiscard]] const std::string& Name(size_t image) const { return list_.samples[image].name; }

  // Threads such that their readers, each taking `bytes`, stay within the readers' share together.
  [[nodiscard]] RunContext Limited(uint64_t bytes) const {
    RunContext limited = context_;
    const uint64_t fit = read_options_.memory_limit_bytes / std::max<uint64_t>(bytes, 1);
    limited.num_threads = static_cast<int>(std::clamp<uint64_t>(fit, 1, NumThreads(context_)));
    return limited;
  }

  // Opens every image: sizes must agree; working_bytes_ is the most that any needs.
  absl::Status CheckHeaders() {
    const size_t num_images = list_.samples.size();
    headers_.resize(num_images);
    std::vector<absl::Status> statuses(num_images);
    std::vector<uint64_t> working(num_images);
    ImageProgress progress(context_, "check", num_images);
    ParallelFor(Limited(list_.images->open_bytes()), 0, static_cast<int64_t>(num_images), 8,
                [&](int64_t begin, int64_t end) {
                  for (int64_t i = begin; i < end && !context_.stop.stop_requested(); ++i) {
                    statuses[i] = list_.images->WithReader(i, read_options_, [&](ImageReader& reader) {
                      headers_[i] = reader.header();
                      working[i] = reader.working_bytes();
                      return absl::OkStatus();
                    });
                    progress.Advance();
                  }
                });
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    TESSERA_RETURN_IF_ERROR(Summarise(statuses, "cannot be read"));
    reader_bytes_ = list_.images->open_bytes() + *std::max_element(working.begin(), working.end());
    return CheckSizes();
  }

  // All like the most frequent size.
  absl::Status CheckSizes() {
    std::map<std::pair<int, int>, size_t> counts;
    for (const ImageHeader& header : headers_) {
      ++counts[{header.width, header.height}];
    }
    const auto most = std::max_element(counts.begin(), counts.end(),
                                       [](const auto& a, const auto& b) { return a.second < b.second; });
    std::tie(width_, height_) = most->first;
    std::vector<absl::Status> statuses(headers_.size());
    for (size_t i = 0; i < headers_.size(); ++i) {
      if (headers_[i].width != width_ || headers_[i].height != height_) {
        statuses[i] = absl::InvalidArgumentError(absl::StrCat(
            Name(i), ": ", headers_[i].width, "x", headers_[i].height, ", expected ", width_, "x", height_));
      }
    }
    return Summarise(statuses, "differ in size");
  }

  [[nodiscard]] Transfer TransferOf(const ImageHeader& header) const {
    return options_.transfer ? *options_.transfer : list_.transfer.value_or(DefaultTransfer(header.format));
  }

  // Codes are kept as they are if one table serves all images, else linear floats.
  void ChooseSamples() {
    layout_.channels = 1;
    bool one_table = true;
    for (const ImageHeader& header : headers_) {
      layout_.channels = std::max(layout_.channels, header.channels);
      const Transfer transfer = TransferOf(header);
      one_table = one_table && header.type == headers_.front().type;
      one_transfer_ = one_transfer_ && transfer == TransferOf(headers_.front());
    }
    one_table = one_table && one_transfer_;
    type_ = one_table ? headers_.front().type : SampleType::kFloat;
    stored_transfer_ = one_table ? TransferOf(headers_.front()) : Transfer::Linear();
    if (!one_table) {
      for (const ImageHeader& header : headers_) {
        tables_.try_emplace({header.format, header.type}, header.type, TransferOf(header));
      }
    }
  }

  absl::Status PlanStorage() {
    const uint64_t budget = options_.memory_budget_bytes;
    layout_.num_texels = int64_t{width_} * height_;
    layout_.num_pairs = static_cast<int64_t>(num_pairs());
    layout_.sample_bytes = SampleBytes(type_);
    image_bytes_ = static_cast<uint64_t>(layout_.num_texels) * layout_.channels * layout_.sample_bytes;
    const uint64_t most_images = budget / kBatchShare / image_bytes_;
    whole_images_ = most_images > 0;
    const int64_t batch =
        std::max<int64_t>(1, static_cast<int64_t>(std::min<uint64_t>(most_images, num_pairs())));
    const int64_t num_batches = (layout_.num_pairs + batch - 1) / batch;
    layout_.batch_pairs = (layout_.num_pairs + num_batches - 1) / num_batches;  // all about equally long
    const uint64_t texel_bytes = layout_.batch_pairs * layout_.channels * layout_.sample_bytes;
    layout_.group_texels =
        std::clamp<int64_t>(static_cast<int64_t>(kWriteBytes / texel_bytes), 1, layout_.num_texels);
    const bool fits = layout_.TotalBytes() <= budget / kMemoryShare;
    TESSERA_ASSIGN_OR_RETURN(storage_, fits ? MakeMemoryStorage(layout_.TotalBytes())
                                            : MakeSpillFile(options_.spill_folder, layout_.TotalBytes()));
    return absl::OkStatus();
  }

  // Decodes batches of whole images in parallel, one image per thread, and transposes each batch.
  absl::Status DecodeInBatches() {
    const std::unique_ptr<std::byte[]> codes(new std::byte[layout_.batch_pairs * image_bytes_]);
    ImageProgress progress(context_, "images", num_pairs());
    for (int64_t batch = 0; batch < layout_.num_batches(); ++batch) {
      const int64_t batch_begin = layout_.BatchBegin(batch);
      std::vector<absl::Status> statuses(layout_.BatchSize(batch));
      ParallelFor(Limited(reader_bytes_), 0, layout_.BatchSize(batch), 1, [&](int64_t i, int64_t /*end*/) {
        std::byte* const image = codes.get() + i * image_bytes_;
        statuses[i] = DecodeImage(grid_.image[batch_begin + i], image, height_,
                                  [](int, int) { return absl::OkStatus(); });
        progress.Advance();
      });
      TESSERA_RETURN_IF_ERROR(context_.CheckStop());
      TESSERA_RETURN_IF_ERROR(Summarise(statuses, "of a batch cannot be decoded"));
      TESSERA_RETURN_IF_ERROR(WriteBatch(layout_, *storage_, batch, 0, layout_.num_texels, codes.get(),
                                         image_bytes_, options_.memory_budget_bytes / kTransferShare,
                                         context_));
    }
    return absl::OkStatus();
  }

  // Images too large to be held: each is a batch of its own and is written band by band as it is decoded.
  absl::Status DecodeInBands() {
    const RunContext limited = Limited(reader_bytes_);
    const size_t row_bytes = image_bytes_ / height_;
    const uint64_t band_bytes = options_.memory_budget_bytes / kBatchShare / NumThreads(limited);
    const int band_rows = static_cast<int>(std::clamp<uint64_t>(band_bytes / row_bytes, 1, height_));
    RunContext single = context_;
    single.num_threads = 1;
    single.progress = nullptr;
    std::vector<absl::Status> statuses(num_pairs());
    ImageProgress progress(context_, "images", num_pairs());
    ParallelFor(limited, 0, layout_.num_pairs, 1, [&](int64_t pair, int64_t /*end*/) {
      const std::unique_ptr<std::byte[]> band(new std::byte[band_rows * row_bytes]);
      const auto write = [&](int row_begin, int row_end) {
        return WriteBatch(layout_, *storage_, pair, int64_t{row_begin} * width_, int64_t{row_end} * width_,
                          band.get(), image_bytes_,
                          options_.memory_budget_bytes / kTransferShare / NumThreads(limited), single);
      };
      statuses[pair] = DecodeImage(grid_.image[pair], band.get(), band_rows, write);
      progress.Advance();
    });
    TESSERA_RETURN_IF_ERROR(context_.CheckStop());
    return Summarise(statuses, "cannot be decoded");
  }

  // Decodes an image to stored codes, `band_rows` rows at a time into `band`; `write(row_begin, row_end)` is
  // called after each band.
  absl::Status DecodeImage(size_t image, std::byte* band, int band_rows,
                           const std::function<absl::Status(int, int)>& write) const {
    const auto decode = [&](ImageReader& reader) -> absl::Status {
      const size_t row_bytes = image_bytes_ / height_;
      RowConverter converter(*this, reader.header());
      for (int y = 0; y < height_; ++y) {
        TESSERA_RETURN_IF_ERROR(context_.CheckStop());
        const int row_in_band = y % band_rows;
        std::byte* const row = band + row_in_band * row_bytes;
        TESSERA_RETURN_IF_ERROR(converter.Read(reader, Name(image), y, std::span(row, row_bytes)));
        if (row_in_band == band_rows - 1 || y == height_ - 1) {
          TESSERA_RETURN_IF_ERROR(write(y - row_in_band, y + 1));
        }
      }
      return absl::OkStatus();
    };
    return list_.images->WithReader(image, read_options_, decode);
  }

  // Brings the rows of one image to the stored type and number of channels.
  class RowConverter {
   public:
    RowConverter(const ImageImport& import, const ImageHeader& header)
        : header_(header),
          stored_channels_(import.layout_.channels),
          sample_bytes_(import.layout_.sample_bytes),
          as_is_(import.tables_.empty() && header.channels == import.layout_.channels) {
      if (!as_is_) {
        native_.resize((RowBytes(header) + 3) / 4);
      }
      if (!import.tables_.empty()) {
        table_ = &import.tables_.at({header.format, header.type});
        linear_.resize(static_cast<size_t>(header.width) * header.channels);
      }
    }

    absl::Status Read(ImageReader& reader, const std::string& name, int y, std::span<std::byte> stored) {
      const std::span<std::byte> native =
          as_is_ ? stored : std::as_writable_bytes(std::span(native_)).first(RowBytes(header_));
      TESSERA_RETURN_IF_ERROR(reader.ReadRows(1, native));
      const size_t bad = FirstNotFinite(header_.type, native);
      if (bad < native.size() / SampleBytes(header_.type)) {
        return absl::InvalidArgumentError(absl::StrCat(name, ": value at x ", bad / header_.channels, ", y ",
                                                       y, ", channel ", bad % header_.channels,
                                                       " is not a finite number"));
      }
      if (as_is_) {
        return absl::OkStatus();
      }
      std::span<const std::byte> samples = native;
      if (table_ != nullptr) {
        table_->Convert(native, linear_);
        samples = std::as_bytes(std::span(linear_));
      }
      // The same number of channels, or gray to be spread over three.
      const int copies = stored_channels_ / header_.channels;
      for (size_t in = 0, out = 0; in < samples.size(); in += sample_bytes_) {
        for (int copy = 0; copy < copies; ++copy, out += sample_bytes_) {
          std::copy_n(samples.begin() + static_cast<ptrdiff_t>(in), sample_bytes_,
                      stored.begin() + static_cast<ptrdiff_t>(out));
        }
      }
      return absl::OkStatus();
    }

   private:
    ImageHeader header_;
    int stored_channels_;
    size_t sample_bytes_;
    bool as_is_;
    const SampleTable* table_ = nullptr;  // where codes are not kept as they are
    std::vector<uint32_t> native_;        // words, so that it is aligned for every type
    std::vector<float> linear_;
  };

  [[nodiscard]] std::vector<float> PairScale() const {
    std::vector<float> scale;
    if (!list_.scale.empty()) {
      for (const size_t image : grid_.image) {
        scale.push_back(list_.scale[image]);
      }
    }
    return scale;
  }

  [[nodiscard]] BtfInfo Info() {
    BtfInfo info;
    info.width = width_;
    info.height = height_;
    info.views = std::move(grid_.views);
    info.lights = std::move(grid_.lights);
    info.provenance = options_.provenance;
    const auto inherit = [](std::string& value, const std::string& other) {
      value = value.empty() ? other : value;
    };
    inherit(info.provenance.source, list_.provenance.source);
    inherit(info.provenance.licence, list_.provenance.licence);
    inherit(info.provenance.citation, list_.provenance.citation);
    info.radiometry = absl::StrCat(
        "image values taken as pi f_r cos(theta_i), transfer ",
        one_transfer_ ? TransferName(TransferOf(headers_.front())) : "srgb for PNG and JPEG, linear for EXR",
        list_.scale.empty() ? "" : ", times the manifest's scale");
    return info;
  }

  ImageList list_;
  const ImportOptions& options_;
  ImageReadOptions read_options_;
  const RunContext& context_;

  SampleGrid grid_;
  std::vector<ImageHeader> headers_;  // [image]
  uint64_t reader_bytes_ = 0;         // of the most demanding image
  int width_ = 0;
  int height_ = 0;
  SampleType type_ = SampleType::kU8;  // as stored
  Transfer stored_transfer_;
  bool one_transfer_ = true;
  std::map<std::pair<ImageFormat, SampleType>, SampleTable> tables_;  // empty: codes are kept as they are
  SampleLayout layout_;
  uint64_t image_bytes_ = 0;  // as stored
  bool whole_images_ = true;
  std::unique_ptr<SampleStorage> storage_;
};

}  // namespace

ImageReadOptions ImportReadOptions(const ImportOptions& options) {
  return {.alpha = AlphaUse::kDrop, .memory_limit_bytes = options.memory_budget_bytes / kReaderShare};
}

absl::StatusOr<std::unique_ptr<BtfSource>> ImportImages(ImageList list, const ImportOptions& options,
                                                        const RunContext& context) {
  return ImageImport(std::move(list), options, context).Run();
}

}  // namespace tessera
