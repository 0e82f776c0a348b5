// A container as one zstd frame: of many small sections, whose names and shapes take more bytes than they do.
//
//   TESSERA_ASSIGN_OR_RETURN(std::string bytes, FrameContainer(container));
//   TESSERA_ASSIGN_OR_RETURN(Container container, ParseFrame(bytes));
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include <absl/status/statusor.h>

#include "btf/codec/container.h"

namespace tessera {

// Of a container in a frame.
inline constexpr uint64_t kMaxFramedBytes = uint64_t{512} << 20;

// SerializeContainer's bytes as a frame of one content size, or as they are where that would not shrink, or
// expand beyond kMaxFramedBytes or the limits of container.h. Errors: SerializeContainer's.
[[nodiscard]] absl::StatusOr<std::string> FrameContainer(Container container);

// Either. Safe on hostile bytes. Errors: DATA_LOSS naming the frame's size, or what zstd says of it;
// ParseContainer's.
[[nodiscard]] absl::StatusOr<Container> ParseFrame(std::span<const std::byte> bytes);

}  // namespace tessera
