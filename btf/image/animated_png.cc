#include "btf/image/animated_png.h"

#include <cstdint>
#include <string_view>
#include <vector>

#include <absl/strings/str_cat.h>
#include <zlib.h>

#include "btf/base/status_macros.h"

namespace tessera {
namespace {

constexpr std::string_view kPngSignature("\x89PNG\r\n\x1a\n", 8);
constexpr size_t kMostFrames = 65535;
constexpr size_t kHeaderBytes = 13;

void AppendBigEndian(uint32_t value, int bytes, std::string& out) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) {
    out.push_back(static_cast<char>(value >> shift));
  }
}

uint32_t ReadBigEndian(std::string_view bytes) {
  uint32_t value = 0;
  for (int i = 0; i < 4; ++i) {
    value = value << 8 | static_cast<uint8_t>(bytes[i]);
  }
  return value;
}

// Length, type, data, checksum of the two.
void AppendChunk(std::string_view type, std::string_view data, std::string& out) {
  AppendBigEndian(static_cast<uint32_t>(data.size()), 4, out);
  const size_t begin = out.size();
  out.append(type).append(data);
  const auto* const checked = reinterpret_cast<const Bytef*>(out.data() + begin);
  AppendBigEndian(static_cast<uint32_t>(crc32(0, checked, static_cast<uInt>(out.size() - begin))), 4, out);
}

// What an animation takes over from a frame.
struct FrameChunks {
  std::string_view header;
  std::string ancillary;  // chunks before the pixels, whole
  std::vector<std::string_view> pixels;
};

absl::StatusOr<FrameChunks> ChunksOf(std::string_view png) {
  if (!png.starts_with(kPngSignature)) {
    return absl::InvalidArgumentError("not a PNG");
  }
  FrameChunks chunks;
  png.remove_prefix(kPngSignature.size());
  while (true) {
    constexpr size_t kAround = 12;
    const uint64_t length = png.size() < kAround ? png.size() : ReadBigEndian(png);
    if (length + kAround > png.size()) {
      return absl::InvalidArgumentError("truncated PNG");
    }
    const std::string_view type = png.substr(4, 4);
    const std::string_view data = png.substr(8, length);
    if (type == "IEND") {
      break;
    }
    if (type == "IHDR") {
      chunks.header = data;
    } else if (type == "IDAT") {
      chunks.pixels.push_back(data);
    } else if (chunks.pixels.empty()) {
      chunks.ancillary.append(png.substr(0, length + kAround));
    }
    png.remove_prefix(length + kAround);
  }
  if (chunks.header.size() != kHeaderBytes || chunks.pixels.empty()) {
    return absl::InvalidArgumentError("PNG without header or pixels");
  }
  return chunks;
}

// The whole of the picture, replaced; both methods 0.
std::string FrameControl(uint32_t sequence, std::string_view header, int frames_per_second) {
  std::string data;
  AppendBigEndian(sequence, 4, data);
  data.append(header.substr(0, 8));  // width and height
  data.append(8, '\0');              // offsets
  AppendBigEndian(1, 2, data);
  AppendBigEndian(static_cast<uint32_t>(frames_per_second), 2, data);
  data.append(2, '\0');
  return data;
}

}  // namespace

absl::StatusOr<std::string> AnimatedPng(std::span<const std::string> frames, const AnimationParams& params) {
  if (frames.empty() || frames.size() > kMostFrames) {
    return absl::InvalidArgumentError(absl::StrCat(frames.size(), " frames, expected 1 to ", kMostFrames));
  }
  constexpr int kMostPerSecond = 100;
  if (params.frames_per_second < 1 || params.frames_per_second > kMostPerSecond || params.loops < 0) {
    return absl::InvalidArgumentError(absl::StrCat(params.frames_per_second, " frames a second, ",
                                                   params.loops, " loops; expected 1 to ", kMostPerSecond,
                                                   " and no negative loops"));
  }
  std::string out(kPngSignature);
  std::string first_header;
  uint32_t sequence = 0;
  for (size_t i = 0; i < frames.size(); ++i) {
    const absl::StatusOr<FrameChunks> chunks = ChunksOf(frames[i]);
    if (!chunks.ok()) {
      return absl::InvalidArgumentError(absl::StrCat("frame ", i, ": ", chunks.status().message()));
    }
    if (i == 0) {
      first_header = std::string(chunks->header);
      AppendChunk("IHDR", chunks->header, out);
      std::string control;
      AppendBigEndian(static_cast<uint32_t>(frames.size()), 4, control);
      AppendBigEndian(static_cast<uint32_t>(params.loops), 4, control);
      AppendChunk("acTL", control, out);
      out.append(chunks->ancillary);
    } else if (chunks->header != first_header) {
      return absl::InvalidArgumentError(
          absl::StrCat("frame ", i, " differs from the first in size or colour type"));
    }
    AppendChunk("fcTL", FrameControl(sequence++, chunks->header, params.frames_per_second), out);
    for (const std::string_view pixels : chunks->pixels) {
      if (i == 0) {
        AppendChunk("IDAT", pixels, out);
      } else {
        std::string data;
        AppendBigEndian(sequence++, 4, data);
        AppendChunk("fdAT", data.append(pixels), out);
      }
    }
  }
  AppendChunk("IEND", "", out);
  return out;
}

}  // namespace tessera
