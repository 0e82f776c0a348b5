// Synthesis of a measured material, the wool of the University of Bonn [Sattler2003].
#include <cmath>
#include <string>

#include <absl/strings/str_format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"
#include "btf/codec/codec.h"
#include "btf/data/import.h"
#include "btf/tiles/anisotropy.h"
#include "btf/tiles/synthesize.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

using testing::HasSubstr;

TEST(WoolTilesTest, LiesInThePlaneAndIsNotTurned) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto source = ImportBtf(TestData(kWool), {}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  const absl::StatusOr<Material> wool =
      FindCodec("dsh-cls")->Encode(**source, {.kl = 9, .kv = 9}, RunContext{});
  ASSERT_TRUE(wool.ok()) << wool.status();
  SynthesisParams params;
  params.tile_size = 32;
  params.strip_height = 16;

  const absl::StatusOr<TileSet> turned =
      SynthesizeTileSet(*wool, **FindArrangement("surface-96"), params, RunContext{});
  ASSERT_EQ(turned.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ReasonOf(turned.status()), "NOT_ISOTROPIC");

  const absl::StatusOr<TileSet> set =
      SynthesizeTileSet(*wool, **FindArrangement("plane-16"), params, RunContext{});
  ASSERT_TRUE(set.ok()) << set.status();
  const double anisotropy = set->metadata["pattern"]["anisotropy"].get<double>();
  EXPECT_GT(anisotropy, kAnisotropyLimit);
  EXPECT_THAT(std::string(turned.status().message()),
              HasSubstr(absl::StrFormat("not isotropic: anisotropy %.2f ", anisotropy)));
  EXPECT_THAT(std::string(turned.status().message()),
              HasSubstr(absl::StrFormat("limit %.2f", kAnisotropyLimit)));
  EXPECT_EQ(set->metadata["thresholds_reached"], true);
  for (const char* const part : {"borders", "insides"}) {
    for (const char* const figure : {"ratio", "ratio_p95", "ratio_worst", "ratio_run_p95"}) {
      const double value = set->certificate[part][figure].get<double>();
      EXPECT_TRUE(std::isfinite(value) && value > 0.0) << part << " " << figure << " " << value;
    }
  }
  EXPECT_GT(set->certificate["borders"]["cut_share"].get<double>(), 0.0) << "not one patch for all corners";
}

}  // namespace
}  // namespace tessera
