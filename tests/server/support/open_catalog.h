// A catalog and a blob store in a folder, with a clock that the test moves.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include <gtest/gtest.h>

#include "server/catalog/blob_store.h"
#include "server/catalog/connections.h"

namespace tessera {

inline constexpr uint64_t kTestMaxUploadBytes = 64 << 20;

struct OpenCatalog {
  explicit OpenCatalog(const std::filesystem::path& folder) {
    auto opened = Connections::Open(folder / "catalog.sqlite");
    EXPECT_TRUE(opened.ok()) << opened.status();
    connections = *std::move(opened);
    auto store = BlobStore::Open(
        folder, *connections, [this] { return now_ms; }, kTestMaxUploadBytes);
    EXPECT_TRUE(store.ok()) << store.status();
    blobs = *std::move(store);
  }

  // Runs a write and returns its result.
  template <typename T>
  absl::StatusOr<T> Write(const std::function<absl::StatusOr<T>(Database&)>& body) {
    absl::StatusOr<T> result = absl::UnknownError("not run");
    const absl::Status status = connections->Write([&](Database& db) {
      result = body(db);
      return result.status();
    });
    return status.ok() ? std::move(result) : absl::StatusOr<T>(status);
  }

  int64_t now_ms = 1'700'000'000'000;
  std::unique_ptr<Connections> connections;
  std::unique_ptr<BlobStore> blobs;
};

// Bytes that depend on the seed and do not repeat.
inline std::string TestBytes(size_t size, uint64_t seed) {
  std::string bytes(size, '\0');
  uint64_t state = seed * 0x9e3779b97f4a7c15ULL + 1;
  for (char& byte : bytes) {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    byte = static_cast<char>(state >> 56);
  }
  return bytes;
}

}  // namespace tessera
