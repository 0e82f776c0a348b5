#include <array>
#include <mutex>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"
#include "btf/data/error_list.h"
#include "btf/data/layouts.h"
#include "btf/image/exr_file.h"

namespace tessera {

namespace {

constexpr std::array<std::string_view, 4> kAngleAttributes = {"lightPolarDeg", "lightAzimuthDeg",
                                                              "viewPolarDeg", "viewAzimuthDeg"};
// What OpenEXR holds of a part's header and chunk table, roughly, measured on small parts.
constexpr uint64_t kBytesPerPart = 6 << 10;
// OpenEXR keeps the line buffers of every part it has read until the file is closed, so files are closed
// after that many bytes of them.
constexpr uint64_t kMaxRetainedShare = 32;

class ExrImages : public ImageSet {
 public:
  ExrImages(std::function<absl::StatusOr<std::unique_ptr<ByteStream>>()> open, std::string name,
            uint64_t memory_limit_bytes)
      : open_(std::move(open)),
        name_(std::move(name)),
        max_retained_(memory_limit_bytes / kMaxRetainedShare) {}

  void Add(std::shared_ptr<ExrFile> file, uint64_t in_memory_bytes) {
    open_bytes_ = file->num_parts() * kBytesPerPart + max_retained_ + in_memory_bytes;
    idle_.push_back(std::move(file));
  }

  [[nodiscard]] absl::Status WithReader(size_t index, const ImageReadOptions& options,
                                        const std::function<absl::Status(ImageReader&)>& use) const override {
    TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<ExrFile> file, Take(options));
    absl::Status status;
    {
      absl::StatusOr<std::unique_ptr<ImageReader>> reader = file->OpenPart(static_cast<int>(index));
      status = reader.ok() ? use(**reader) : reader.status();
    }
    if (file->retained_bytes() <= max_retained_) {
      const std::lock_guard lock(mutex_);
      idle_.push_back(std::move(file));
    }
    return status;
  }
  [[nodiscard]] uint64_t open_bytes() const override { return open_bytes_; }

 private:
  absl::StatusOr<std::shared_ptr<ExrFile>> Take(const ImageReadOptions& options) const {
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        std::shared_ptr<ExrFile> file = std::move(idle_.back());
        idle_.pop_back();
        return file;
      }
    }
    TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<ByteStream> stream, open_());
    return ExrFile::Open(std::move(stream), name_, options);
  }

  std::function<absl::StatusOr<std::unique_ptr<ByteStream>>()> open_;
  std::string name_;
  uint64_t max_retained_;
  uint64_t open_bytes_ = 0;
  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<ExrFile>> idle_;  // guarded by mutex_
};

}  // namespace

absl::StatusOr<ImageList> ListExr(std::function<absl::StatusOr<std::unique_ptr<ByteStream>>()> open,
                                  const std::string& name, const ImageReadOptions& options) {
  TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<ByteStream> stream, open());
  const uint64_t in_memory_bytes = stream->seekable() ? 0 : stream->size();
  TESSERA_ASSIGN_OR_RETURN(std::shared_ptr<ExrFile> file, ExrFile::Open(std::move(stream), name, options));
  if (static_cast<uint64_t>(file->num_parts()) > kMaxFiles) {
    return absl::ResourceExhaustedError(
        absl::StrCat(name, ": ", file->num_parts(), " parts, the limit is ", kMaxFiles));
  }
  ImageList list;
  ErrorList faults;
  for (int part = 0; part < file->num_parts(); ++part) {
    std::array<double, 4> angles{};
    for (size_t i = 0; i < angles.size(); ++i) {
      const std::optional<double> value = file->FloatAttribute(part, kAngleAttributes[i]);
      angles[i] = value.value_or(0.0);
      if (!value) {
        faults.Add(absl::StrCat("part ", part, " has no ",
                                absl::string_view(kAngleAttributes[i].data(), kAngleAttributes[i].size())));
      }
    }
    const std::string part_name = file->PartName(part);
    list.samples.push_back({absl::StrCat("part ", part, part_name.empty() ? "" : " ", part_name),
                            {angles[0], angles[1]},
                            {angles[2], angles[3]}});
  }
  if (!faults.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(name, ": ", faults.count(), " float attributes missing: ", faults.Text()));
  }
  auto images = std::make_unique<ExrImages>(std::move(open), name, options.memory_limit_bytes);
  images->Add(std::move(file), in_memory_bytes);
  list.images = std::move(images);
  return list;
}

}  // namespace tessera
