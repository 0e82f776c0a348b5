// Where measured test data lies, if it is there at all.
#pragma once

#include <filesystem>

namespace tessera {

// A wool of 128x128 texels under 81 views and 81 lights, a UBO2003 zip, gamma 2.2; for TestData().
inline constexpr char kWool[] = "btf/ubo2003_wool128/UBO_WOOL128_decoded.zip";

// A file or folder below the configured data folder (TESSERA_DATA_DIR). Tests that need it skip, by name,
// when it does not exist.
inline std::filesystem::path TestData(const std::filesystem::path& relative) {
  return std::filesystem::path(TESSERA_DATA_DIR) / relative;
}

}  // namespace tessera

// Skips the running test when measured data is absent.
#define TESSERA_REQUIRE_DATA(relative)                           \
  if (!std::filesystem::exists(::tessera::TestData(relative))) { \
    GTEST_SKIP() << "measured data not present: " << (relative); \
  }                                                              \
  static_assert(true)
