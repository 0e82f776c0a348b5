#include "client/cli/contact_sheet.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "btf/image/image_io.h"

namespace tessera::cli {
namespace {

constexpr int kGap = 8;

}  // namespace

absl::StatusOr<Image> ContactSheet(const std::vector<Image>& pictures, int columns) {
  if (pictures.empty() || columns < 0) {
    return absl::InvalidArgumentError(fmt::format(
        "a sheet of {} pictures in {} columns: expected at least one picture and no negative columns",
        pictures.size(), columns));
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
  const int64_t width = num_columns * (cell_width + kGap) + kGap;
  const int64_t height = num_rows * (cell_height + kGap) + kGap;
  if (width > kMaxImageSide || height > kMaxImageSide) {
    return absl::InvalidArgumentError(
        fmt::format("a sheet of {}x{} pixels: at most {} on a side", width, height, kMaxImageSide));
  }
  Image sheet(static_cast<int>(width), static_cast<int>(height), 3);
  std::fill(sheet.pixels.begin(), sheet.pixels.end(), 1.0F);
  for (int i = 0; i < num_pictures; ++i) {
    const Image& picture = pictures[i];
    const auto left =
        static_cast<int>(kGap + (i % num_columns) * (cell_width + kGap) + (cell_width - picture.width) / 2);
    const auto top = static_cast<int>(kGap + (i / num_columns) * (cell_height + kGap) +
                                      (cell_height - picture.height) / 2);
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
  return sheet;
}

}  // namespace tessera::cli
