#include "btf/codec/container_frame.h"

#include <cstdint>
#include <cstring>
#include <utility>

#include <absl/strings/str_cat.h>
#include <zstd.h>

#include "btf/base/status_macros.h"
#include "btf/codec/container_layout.h"

namespace tessera {
namespace {

// Small ones are squeezed: they are what is waited for.
constexpr size_t kSmallBytes = size_t{1} << 18;
constexpr int kSmallLevel = 19;
constexpr int kLevel = 3;

bool IsContainer(std::span<const std::byte> bytes) {
  return bytes.size() >= kContainerMagic.size() &&
         std::memcmp(bytes.data(), kContainerMagic.data(), kContainerMagic.size()) == 0;
}

}  // namespace

absl::StatusOr<std::string> FrameContainer(Container container) {
  TESSERA_ASSIGN_OR_RETURN(std::string bytes, SerializeContainer(std::move(container)));
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const size_t size = ZSTD_compress(frame.data(), frame.size(), bytes.data(), bytes.size(),
                                    bytes.size() <= kSmallBytes ? kSmallLevel : kLevel);
  if (ZSTD_isError(size)) {
    return absl::InternalError(absl::StrCat("container frame: zstd: ", ZSTD_getErrorName(size)));
  }
  if (size >= bytes.size() || bytes.size() > kMaxFramedBytes || !ExpandsWithinLimits(bytes.size(), size)) {
    return bytes;
  }
  frame.resize(size);
  return frame;
}

absl::StatusOr<Container> ParseFrame(std::span<const std::byte> bytes) {
  if (IsContainer(bytes)) {
    return ParseContainer(bytes);
  }
  const uint64_t size = ZSTD_getFrameContentSize(bytes.data(), bytes.size());
  if (size == ZSTD_CONTENTSIZE_ERROR || size == ZSTD_CONTENTSIZE_UNKNOWN || size > kMaxFramedBytes ||
      !ExpandsWithinLimits(size, bytes.size())) {
    return absl::DataLossError(absl::StrCat("neither a container nor a zstd frame of one: ", bytes.size(),
                                            " bytes that expand to ", size, ", at most ", kMaxFramedBytes));
  }
  std::string container(size, '\0');
  const size_t got = ZSTD_decompress(container.data(), container.size(), bytes.data(), bytes.size());
  if (ZSTD_isError(got) || got != size) {
    return absl::DataLossError(absl::StrCat("container frame: zstd: ",
                                            ZSTD_isError(got) ? ZSTD_getErrorName(got) : "too few bytes"));
  }
  return ParseContainer(std::as_bytes(std::span(container)));
}

}  // namespace tessera
