#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "btf/base/status_macros.h"
#include "btf/data/layouts.h"

namespace tessera {

namespace {

bool EndsWithIgnoringCase(std::string_view name, std::string_view ending) {
  return name.size() >= ending.size() &&
         std::equal(ending.begin(), ending.end(), name.end() - static_cast<ptrdiff_t>(ending.size()),
                    [](char a, char b) { return a == std::tolower(static_cast<unsigned char>(b)); });
}

class FileImages : public ImageSet {
 public:
  FileImages(std::shared_ptr<const FileSet> set, std::vector<size_t> files)
      : set_(std::move(set)), files_(std::move(files)) {
    for (const size_t file : files_) {
      const FileEntry& entry = set_->files()[file];
      // OpenEXR seeks, so a compressed file is unpacked to memory first.
      if (!entry.seekable && HasExrName(entry.name)) {
        open_bytes_ = std::max(open_bytes_, entry.size_bytes);
      }
    }
  }

  [[nodiscard]] absl::Status WithReader(size_t index, const ImageReadOptions& options,
                                        const std::function<absl::Status(ImageReader&)>& use) const override {
    const size_t file = files_[index];
    TESSERA_ASSIGN_OR_RETURN(std::unique_ptr<ByteStream> stream, set_->Open(file));
    TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<ImageReader> reader,
                             OpenImage(std::move(stream), set_->files()[file].name, options));
    return use(*reader);
  }
  [[nodiscard]] uint64_t open_bytes() const override { return open_bytes_; }

 private:
  std::shared_ptr<const FileSet> set_;
  std::vector<size_t> files_;
  uint64_t open_bytes_ = 0;
};

}  // namespace

std::unique_ptr<ImageSet> MakeFileImages(std::shared_ptr<const FileSet> set, std::vector<size_t> files) {
  return std::make_unique<FileImages>(std::move(set), std::move(files));
}

bool HasImageName(std::string_view name) {
  constexpr std::array<std::string_view, 4> kEndings = {".jpg", ".jpeg", ".png", ".exr"};
  return std::any_of(kEndings.begin(), kEndings.end(),
                     [&](std::string_view ending) { return EndsWithIgnoringCase(name, ending); });
}

bool HasExrName(std::string_view name) {
  return EndsWithIgnoringCase(name, ".exr");
}

}  // namespace tessera
