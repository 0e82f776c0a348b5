// A temporary file without a name: bytes that memory has no room for. It is gone with the object, even after
// a kill, and a full disk shows when it is made, not while it is filled.
//
//   TESSERA_ASSIGN_OR_RETURN(SpillFile file, SpillFile::Create(/*folder=*/{}, size_bytes));
//   TESSERA_RETURN_IF_ERROR(file.Write(offset, bytes));
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

namespace tessera {

// Write and Read are thread-safe for disjoint ranges.
class SpillFile {
 public:
  // `size_bytes` zeros in `folder`; empty: the system's folder for temporary files ($TMPDIR). Their space is
  // reserved, so that nobody else can take it before they are written. Errors: RESOURCE_EXHAUSTED naming the
  // bytes needed and free, else FileError's.
  [[nodiscard]] static absl::StatusOr<SpillFile> Create(const std::filesystem::path& folder,
                                                        uint64_t size_bytes);
  SpillFile(SpillFile&& other) noexcept;
  SpillFile& operator=(SpillFile&& other) noexcept;
  ~SpillFile();

  // Plain reads and writes: they count as the system's memory, not as this process's. Ranges lie within the
  // size. Errors: FileError's, DATA_LOSS.
  [[nodiscard]] absl::Status Write(uint64_t offset, std::span<const std::byte> bytes);
  [[nodiscard]] absl::Status Read(uint64_t offset, std::span<std::byte> bytes) const;

  // The file in the address space, as long as the object lives: pages that are touched count as this
  // process's memory until they are dropped. Errors: FileError's.
  [[nodiscard]] absl::StatusOr<std::span<std::byte>> Map();
  // Takes the mapped pages out of this process's memory; what was written to them is kept, and touched again
  // they come back.
  void DropPages() const;

 private:
  SpillFile(int descriptor, uint64_t size_bytes, std::string name);

  int descriptor_ = -1;
  uint64_t size_bytes_ = 0;
  void* mapped_ = nullptr;
  std::string name_;  // for messages
};

}  // namespace tessera
