#include "btf/chart/jpeg_peer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <span>
#include <string>

#include "btf/base/cpu_time.h"
#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"
#include "btf/image/jpeg_writer.h"
#include "btf/metrics/ssim.h"

namespace tessera {
namespace {

// For each direction the kept one at the least angle.
std::vector<int> NearestKept(const std::vector<Direction>& directions) {
  const std::vector<int> kept = KeptDirections(directions.size());
  std::vector<int> nearest;
  for (const Direction& direction : directions) {
    nearest.push_back(*std::ranges::max_element(kept, {}, [&](int i) {
      return VectorFromDirection(directions[i]).dot(VectorFromDirection(direction));
    }));
  }
  return nearest;
}

const std::array<float, 256>& LinearOfCode() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (size_t i = 0; i < values.size(); ++i) {
      values[i] = static_cast<float>(LinearFromSrgb(static_cast<double>(i) / 255.0));
    }
    return values;
  }();
  return table;
}

// Codes / 255.
absl::StatusOr<Image> DecodeCodes(const std::string& jpeg) {
  return DecodeImage(std::as_bytes(std::span(jpeg)), "JPEG of the chart", Transfer::Linear());
}

uint8_t CodeOf(float encoded) {
  return static_cast<uint8_t>(std::lround(255.0F * encoded));
}

// The first error of a parallel loop, in the order of its items.
absl::Status FirstError(const std::vector<absl::Status>& statuses) {
  const auto failed = std::ranges::find_if(statuses, [](const absl::Status& s) { return !s.ok(); });
  return failed == statuses.end() ? absl::OkStatus() : *failed;
}

}  // namespace

absl::StatusOr<JpegPeer> JpegPeer::Create(BtfSource& source, int row_stride, const RunContext& context) {
  const BtfInfo& info = source.info();
  JpegPeer peer;
  peer.width_ = info.width;
  peer.height_ = info.height;
  peer.row_stride_ = row_stride;
  peer.num_lights_ = info.lights.size();
  peer.num_images_ = info.views.size() * info.lights.size();
  peer.nearest_kept_view_ = NearestKept(info.views);
  peer.nearest_kept_light_ = NearestKept(info.lights);
  const size_t row_codes = static_cast<size_t>(info.width) * 3;
  peer.codes_.resize(peer.num_images_ * info.height * row_codes);
  std::vector<float> samples(source.SamplesPerRow());
  constexpr int64_t kImagesPerTask = 16;
  for (int y = 0; y < info.height; ++y) {
    TESSERA_RETURN_IF_ERROR(source.ReadRows(y, 1, samples, context));
    ParallelFor(
        context, 0, static_cast<int64_t>(peer.num_images_), kImagesPerTask, [&](int64_t begin, int64_t end) {
          Image rows(info.width, static_cast<int>(end - begin), 3);
          for (size_t sample = 0; sample < row_codes; ++sample) {
            for (int64_t i = begin; i < end; ++i) {
              rows.at(0, static_cast<int>(i - begin))[sample] = samples[sample * peer.num_images_ + i];
            }
          }
          rows = SrgbCoded(rows);
          for (int64_t i = begin; i < end; ++i) {
            std::transform(
                rows.at(0, static_cast<int>(i - begin)), rows.at(0, static_cast<int>(i - begin)) + row_codes,
                peer.codes_.begin() + static_cast<ptrdiff_t>((i * info.height + y) * row_codes), CodeOf);
          }
        });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
  }
  return peer;
}

absl::StatusOr<JpegSet> JpegPeer::Encode(int quality, const RunContext& context) const {
  const size_t row_codes = static_cast<size_t>(width_) * 3;
  const size_t image_codes = row_codes * height_;
  const int kept_rows = (height_ + row_stride_ - 1) / row_stride_;
  JpegSet set{.quality = quality};
  std::vector<std::string> files(num_images_);
  std::vector<absl::Status> statuses(num_images_);
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start = ProcessCpuSeconds();
  constexpr int64_t kImagesPerTask = 8;
  ParallelFor(context, 0, static_cast<int64_t>(num_images_), kImagesPerTask, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      absl::StatusOr<std::string> file =
          EncodeJpeg(std::span(codes_).subspan(i * image_codes, image_codes), width_, height_, quality);
      statuses[i] = file.status();
      if (file.ok()) {
        files[i] = *std::move(file);
      }
    }
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_RETURN_IF_ERROR(FirstError(statuses));
  set.encode_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  set.encode_cpu_s = ProcessCpuSeconds() - cpu_start;
  for (const std::string& file : files) {
    set.size_bytes += file.size();
  }
  set.rows.resize(num_images_ * kept_rows * row_codes);
  ParallelFor(context, 0, static_cast<int64_t>(num_images_), kImagesPerTask, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      const absl::StatusOr<Image> image = DecodeCodes(files[i]);
      statuses[i] = image.status();
      for (int row = 0; image.ok() && row < kept_rows; ++row) {
        std::transform(image->at(0, row * row_stride_), image->at(0, row * row_stride_) + row_codes,
                       set.rows.begin() + static_cast<ptrdiff_t>((i * kept_rows + row) * row_codes), CodeOf);
      }
    }
  });
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  TESSERA_RETURN_IF_ERROR(FirstError(statuses));
  // The decoder's time alone, on this thread.
  constexpr size_t kTimedImages = 64;
  const size_t step = std::max<size_t>(1, num_images_ / kTimedImages);
  size_t timed = 0;
  const double decode_start = ThreadCpuSeconds();
  for (size_t i = 0; i < num_images_; i += step, ++timed) {
    TESSERA_RETURN_IF_ERROR(
        DecodeImage(std::as_bytes(std::span(files[i])), "JPEG of the chart", Transfer::Srgb()).status());
  }
  set.decode_s = (ThreadCpuSeconds() - decode_start) / static_cast<double>(timed);
  return set;
}

absl::StatusOr<int> JpegPeer::QualityFor(uint64_t size_bytes, const RunContext& context) const {
  const size_t image_codes = static_cast<size_t>(width_) * 3 * height_;
  int least = 1;
  int most = 100;
  while (least < most) {
    const int quality = (least + most + 1) / 2;
    std::vector<uint64_t> sizes(num_images_);
    std::vector<absl::Status> statuses(num_images_);
    ParallelFor(context, 0, static_cast<int64_t>(num_images_), 8, [&](int64_t begin, int64_t end) {
      for (int64_t i = begin; i < end; ++i) {
        const absl::StatusOr<std::string> file =
            EncodeJpeg(std::span(codes_).subspan(i * image_codes, image_codes), width_, height_, quality);
        statuses[i] = file.status();
        sizes[i] = file.ok() ? file->size() : 0;
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    TESSERA_RETURN_IF_ERROR(FirstError(statuses));
    uint64_t total = 0;
    for (const uint64_t size : sizes) {
      total += size;
    }
    if (total <= size_bytes) {
      least = quality;
    } else {
      most = quality - 1;
    }
  }
  return least;
}

size_t JpegPeer::ShownImage(Split split, int view, int light) const {
  const int shown_view = split == Split::kHeldOutViews ? nearest_kept_view_[view] : view;
  const int shown_light = split == Split::kHeldOutLights ? nearest_kept_light_[light] : light;
  return static_cast<size_t>(shown_view) * num_lights_ + shown_light;
}

void JpegPeer::Row(const JpegSet& set, Split split, int y, int view, int light, std::span<float> rgb) const {
  const size_t kept_rows = set.rows.size() / (num_images_ * static_cast<size_t>(width_) * 3);
  const size_t row = ShownImage(split, view, light) * kept_rows + static_cast<size_t>(y / row_stride_);
  const uint8_t* const codes = set.rows.data() + row * rgb.size();
  for (size_t i = 0; i < rgb.size(); ++i) {
    rgb[i] = LinearOfCode()[codes[i]];
  }
}

absl::StatusOr<Image> JpegPeer::Picture(int quality, Split split, int view, int light) const {
  const size_t image_codes = static_cast<size_t>(width_) * 3 * height_;
  TESSERA_ASSIGN_OR_RETURN(
      const std::string file,
      EncodeJpeg(std::span(codes_).subspan(ShownImage(split, view, light) * image_codes, image_codes), width_,
                 height_, quality));
  return DecodeImage(std::as_bytes(std::span(file)), "JPEG of the chart", Transfer::Srgb());
}

}  // namespace tessera
