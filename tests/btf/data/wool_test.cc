// The measured wool of UBO2003: 6,561 JPEG images in one archive.
#include <chrono>
#include <cmath>

#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "btf/data/import.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

constexpr char kWool[] = "btf/ubo2003_wool128/UBO_WOOL128_decoded.zip";

TEST(WoolTest, ImportsAllImagesAndDirections) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto begin = std::chrono::steady_clock::now();
  const auto source =
      ImportBtf(TestData(kWool), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  const auto imported = std::chrono::steady_clock::now();
  const BtfInfo& info = (*source)->info();
  EXPECT_EQ(info.width, 128);
  EXPECT_EQ(info.height, 128);
  const std::vector<Direction> expected = DirectionSet("ubo81").value();
  for (const auto& directions : {info.views, info.lights}) {
    ASSERT_EQ(directions.size(), expected.size());
    for (size_t i = 0; i < expected.size(); ++i) {
      EXPECT_NEAR(directions[i].theta_rad, expected[i].theta_rad, 1e-9);
      EXPECT_NEAR(directions[i].phi_rad, expected[i].phi_rad, 1e-9);
    }
  }
  constexpr int kRows = 8;
  std::vector<float> rows(kRows * (*source)->SamplesPerRow());
  double sum = 0.0;
  for (int y = 0; y < info.height; y += kRows) {
    ASSERT_TRUE((*source)->ReadRows(y, kRows, rows, RunContext{}).ok());
    for (const float value : rows) {
      sum += double{value} * value;
    }
  }
  const auto read = std::chrono::steady_clock::now();
  // design.md, section 3: linear by gamma 2.2, RMS 0.26.
  EXPECT_NEAR(std::sqrt(sum / (rows.size() / kRows * info.height)), 0.26, 0.01);
  const auto seconds = [](auto duration) { return std::chrono::duration<double>(duration).count(); };
  std::printf("import %.2f s, rows %.2f s\n", seconds(imported - begin), seconds(read - imported));
}

}  // namespace
}  // namespace tessera
