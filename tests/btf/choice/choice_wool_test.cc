// Choices on the measured wool [Sattler2003], 81 views and lights: the uppermost 40 of its 128 rows, in a
// third of the time.
#include <chrono>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"
#include "btf/choice/encode_model.h"
#include "btf/data/import.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

constexpr int kRows = 40;

class TopRows final : public BtfSource {
 public:
  explicit TopRows(std::unique_ptr<BtfSource> source) : source_(std::move(source)), info_(source_->info()) {
    info_.height = kRows;
  }
  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    return source_->ReadRows(row_begin, num_rows, samples, context);
  }

 private:
  std::unique_ptr<BtfSource> source_;
  BtfInfo info_;
};

std::unique_ptr<BtfSource> Wool() {
  ImportOptions options;
  options.transfer = *ParseTransfer("gamma:2.2");
  auto source = ImportBtf(TestData(kWool), options, {});
  EXPECT_TRUE(source.ok()) << source.status();
  return std::make_unique<TopRows>(*std::move(source));
}

TEST(ChoiceWoolTest, ATighterBoundTakesMoreBytes) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto wool = Wool();
  size_t bytes = 0;
  for (const double max_error : {0.08, 0.045}) {
    const auto start = std::chrono::steady_clock::now();
    const auto material = EncodeModel(*wool, {.codec = kAutoCodec, .params = {.max_error = max_error}}, {});
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    ASSERT_TRUE(material.ok()) << material.status();
    const nlohmann::json& choice = material->metadata["choice"];
    std::printf("max_error %g: %.1f s\n", max_error, seconds);
    for (const nlohmann::json& line : choice["report"]) {
      std::printf("  %s\n", line.get<std::string>().c_str());
    }
    // Design: on wool one factorisation beats the others by an order of magnitude in bytes.
    EXPECT_EQ(material->btfels.codec_id, "dfmf");
    EXPECT_LE(choice["chosen"]["held_out_lights_rmse"].get<double>(), max_error);
    EXPECT_LE(choice["chosen"]["held_out_views_rmse"].get<double>(), max_error);
    EXPECT_LE(choice["chosen"]["sampled_rmse"].get<double>(), max_error);
    EXPECT_GT(choice["chosen"]["bytes"].get<size_t>(), bytes);
    bytes = choice["chosen"]["bytes"].get<size_t>();
  }
}

TEST(ChoiceWoolTest, WhatNoModelReachesIsRefused) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto wool = Wool();
  // Held-out views of wool stay at 0.039 and more with every codec.
  const absl::Status status =
      EncodeModel(*wool, {.codec = kAutoCodec, .params = {.max_error = 0.03}}, {}).status();
  EXPECT_EQ(ReasonOf(status), "BOUND_NOT_REACHED");
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("the best is 0.03"));
}

}  // namespace
}  // namespace tessera
