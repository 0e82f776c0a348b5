#include "client/cli/contact_sheet.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "btf/image/image_io.h"
#include "client/cli/caption.h"

namespace tessera::cli {
namespace {

constexpr int kGap = 8;
// Cells at least this wide have letters of two pixels a dot.
constexpr int kLargeLettersFrom = 160;

// Captions below cells of one width.
class Captions {
 public:
  Captions(const std::vector<std::string>& captions, int64_t cell_width)
      : scale_(cell_width >= kLargeLettersFrom ? 2 : 1), cell_width_(static_cast<int>(cell_width)) {
    const int most_letters = cell_width_ / (kLetterPitch * scale_);
    for (const std::string& caption : captions) {
      lines_.push_back(BrokenLines(caption, most_letters));
      most_lines_ = std::max(most_lines_, lines_.back().size());
    }
  }

  // Pixels below each cell.
  [[nodiscard]] int64_t height() const {
    return lines_.empty() ? 0 : kGap / 2 + static_cast<int64_t>(most_lines_) * kLinePitch * scale_;
  }

  // Of picture `i`, whose cell ends at (left, bottom).
  void Draw(size_t i, int left, int bottom, Image& sheet) const {
    if (lines_.empty()) {
      return;
    }
    int y = bottom + kGap / 2;
    for (const std::string& line : lines_[i]) {
      const int width = static_cast<int>(line.size()) * kLetterPitch * scale_;
      DrawLine(line, left + std::max(cell_width_ - width, 0) / 2, y, scale_, sheet);
      y += kLinePitch * scale_;
    }
  }

 private:
  const int scale_;
  const int cell_width_;
  std::vector<std::vector<std::string>> lines_;
  size_t most_lines_ = 0;
};

void LayOver(const Image& picture, int left, int top, Image& sheet) {
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      const float* from = picture.at(x, y);
      float* to = sheet.at(left + x, top + y);
      const float alpha = picture.channels == 4 ? from[3] : 1.0F;
      for (int channel = 0; channel < 3; ++channel) {
        const float value = from[picture.channels == 1 ? 0 : channel];
        to[channel] = alpha * value + (1.0F - alpha) * to[channel];
      }
    }
  }
}

}  // namespace

absl::StatusOr<Image> ContactSheet(const std::vector<Image>& pictures, int columns,
                                   const std::vector<std::string>& captions) {
  if (pictures.empty() || columns < 0) {
    return absl::InvalidArgumentError(fmt::format(
        "a sheet of {} pictures in {} columns: expected at least one picture and no negative columns",
        pictures.size(), columns));
  }
  if (!captions.empty() && captions.size() != pictures.size()) {
    return absl::InvalidArgumentError(fmt::format("{} captions for {} pictures: expected none or as many",
                                                  captions.size(), pictures.size()));
  }
  const auto num_pictures = static_cast<int>(pictures.size());
  const int num_columns = std::min(
      num_pictures,
      columns > 0 ? columns : static_cast<int>(std::ceil(std::sqrt(static_cast<double>(num_pictures)))));
  const int num_rows = (num_pictures + num_columns - 1) / num_columns;
  int64_t cell_width = 0;
  int64_t cell_height = 0;
  for (const Image& picture : pictures) {
    cell_width = std::max<int64_t>(cell_width, picture.width);
    cell_height = std::max<int64_t>(cell_height, picture.height);
  }
  const Captions below(captions, cell_width);
  const int64_t pitch = cell_height + below.height() + kGap;
  const int64_t width = num_columns * (cell_width + kGap) + kGap;
  const int64_t height = num_rows * pitch + kGap;
  if (width > kMaxImageSide || height > kMaxImageSide) {
    return absl::InvalidArgumentError(
        fmt::format("a sheet of {}x{} pixels: at most {} on a side", width, height, kMaxImageSide));
  }
  Image sheet(static_cast<int>(width), static_cast<int>(height), 3);
  std::fill(sheet.pixels.begin(), sheet.pixels.end(), 1.0F);
  for (int i = 0; i < num_pictures; ++i) {
    const Image& picture = pictures[i];
    const auto left = static_cast<int>(kGap + (i % num_columns) * (cell_width + kGap));
    const auto top = static_cast<int>(kGap + (i / num_columns) * pitch);
    LayOver(picture, left + static_cast<int>(cell_width - picture.width) / 2,
            top + static_cast<int>(cell_height - picture.height) / 2, sheet);
    below.Draw(i, left, top + static_cast<int>(cell_height), sheet);
  }
  return sheet;
}

}  // namespace tessera::cli
