// Bytes of one file, whether it lies in a folder, in an archive or in memory. Image readers take them so that
// no file has to be in memory as a whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

class ByteStream {
 public:
  virtual ~ByteStream() = default;

  [[nodiscard]] virtual uint64_t size() const = 0;
  // The next bytes, as many as fit into `bytes`, fewer only at the end. Returns their number, 0 at the end.
  // Errors: INTERNAL or DATA_LOSS from the medium.
  [[nodiscard]] virtual absl::StatusOr<size_t> Read(std::span<std::byte> bytes) = 0;

  // Seek is legal only if seekable(). Errors: INVALID_ARGUMENT beyond the end.
  [[nodiscard]] virtual bool seekable() const = 0;
  [[nodiscard]] virtual absl::Status Seek(uint64_t position) = 0;

  // To be called by readers that have all they want: media with a checksum over the file read on to its end
  // and check it. Errors: DATA_LOSS.
  [[nodiscard]] virtual absl::Status Finish() { return absl::OkStatus(); }
};

// Borrows `bytes`.
[[nodiscard]] std::unique_ptr<ByteStream> MakeMemoryStream(std::span<const std::byte> bytes);
// Owns `bytes`.
[[nodiscard]] std::unique_ptr<ByteStream> MakeMemoryStream(std::string bytes);
// A regular file. Errors: NOT_FOUND, PERMISSION_DENIED, INVALID_ARGUMENT (not a regular file), INTERNAL.
[[nodiscard]] absl::StatusOr<std::unique_ptr<ByteStream>> OpenFileStream(const std::filesystem::path& path);

// All bytes from the current position on. Errors: RESOURCE_EXHAUSTED when the stream says, or turns out, to
// hold more than `limit_bytes`; those of Read.
[[nodiscard]] absl::StatusOr<std::string> ReadAll(ByteStream& stream, uint64_t limit_bytes);

}  // namespace tessera
