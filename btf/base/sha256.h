// SHA-256 of bytes and streams: names of blobs, identity of arrangements and meshes.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

namespace tessera {

// Incremental SHA-256. Not thread-safe.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void Update(std::span<const std::byte> bytes);
  // 64 lower-case hexadecimal digits. The object must not be used afterwards.
  [[nodiscard]] std::string HexDigest();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// 64 lower-case hexadecimal digits.
[[nodiscard]] std::string Sha256Hex(std::span<const std::byte> bytes);

}  // namespace tessera
