#include "btf/tiles/synthesize.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/reason.h"
#include "btf/codec/codec.h"
#include "btf/tiles/anisotropy.h"
#include "btf/tiles/certificate.h"
#include "tests/btf/tiles/made_up_material.h"

namespace tessera {
namespace {

using testing::HasSubstr;

SynthesisParams SmallParams() {
  SynthesisParams params;
  params.tile_size = 16;
  params.strip_height = 8;
  return params;
}

TEST(SynthesizeTileSetTest, ServesEigenTextures) {
  const Material material = MakeMaterial(40, 36, Pattern::kBumps, "view-pca");
  const absl::StatusOr<TileSet> set =
      SynthesizeTileSet(material, **FindArrangement("surface-96"), SmallParams(), RunContext{});
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->btfels.codec_id, "view-pca");
  EXPECT_EQ(set->btfels.tables.size(), 3u);
  const auto bytes = SerializeTileSet(*set);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto read = ParseTileSet(std::as_bytes(std::span(*bytes)));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->btfels.codes, set->btfels.codes);
}

TEST(SynthesizeTileSetTest, EveryTexelIsABtfelOfTheMaterial) {
  const Material material = MakeMaterial(40, 36, Pattern::kBumps);
  const Arrangement& arrangement = **FindArrangement("surface-96");
  const absl::StatusOr<TileSet> set = SynthesizeTileSet(material, arrangement, SmallParams(), RunContext{});
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->arrangement_id, "surface-96");
  EXPECT_EQ(set->arrangement_sha256, arrangement.sha256);
  EXPECT_EQ(set->tile_codes, arrangement.codes);
  EXPECT_EQ(set->tile_index.size(), 96u * 16 * 16);
  EXPECT_EQ(set->provenance.source, "made up");
  EXPECT_EQ(set->radiometry, material.radiometry);
  EXPECT_EQ(set->btfels.tables.size(), material.btfels.tables.size());

  // Each referenced once, in ascending exemplar order.
  std::vector<bool> referenced(set->btfels.size(), false);
  for (const uint32_t texel : set->tile_index) {
    ASSERT_LT(BtfelOfTexel(texel), set->btfels.size());
    referenced[BtfelOfTexel(texel)] = true;
  }
  EXPECT_TRUE(std::all_of(referenced.begin(), referenced.end(), [](bool used) { return used; }));
  size_t pixel = 0;
  for (size_t i = 0; i < set->btfels.size(); ++i) {
    const auto wanted = set->btfels.btfel(i);
    while (pixel < material.btfels.size() &&
           !std::equal(wanted.begin(), wanted.end(), material.btfels.btfel(pixel).begin())) {
      ++pixel;
    }
    ASSERT_LT(pixel, material.btfels.size())
        << "BTFel " << i << " is not in the material after its predecessor";
    ++pixel;
  }

  EXPECT_EQ(set->metadata["seed"], 1);
  EXPECT_EQ(set->metadata["parameters"]["tile_size"], 16);
  EXPECT_DOUBLE_EQ(set->certificate["referenced_share"].get<double>(), set->btfels.size() / 1440.0);
  EXPECT_GT(set->metadata["captured_variance"]["search_share"].get<double>(), 0.5);
  EXPECT_LE(set->metadata["captured_variance"]["cut_share"].get<double>(), 1.0 + 1e-9);
  EXPECT_LE(set->metadata["pattern"]["anisotropy"].get<double>(), kAnisotropyLimit);
  EXPECT_LE(set->metadata["tiles"]["worst_mean_mismatch"].get<double>(), SmallParams().mean_threshold);
  EXPECT_EQ(set->certificate["images"]["of"], material.btfels.views.size() * material.btfels.lights.size());
  EXPECT_EQ(set->certificate["controls"]["false_cuts"], 1.0);
  EXPECT_GT(set->certificate["insides"]["ratio"].get<double>(), 0.0);
  EXPECT_GT(set->certificate["borders"]["verbatim_share"].get<double>(), 0.0);
}

TEST(SynthesizeTileSetTest, DiamondsAreNamedInTheMetadataAndShowTheirSeamsMore) {
  const Material material = MakeMaterial(48, 48, Pattern::kBumps);
  const Arrangement& arrangement = **FindArrangement("plane-16");
  SynthesisParams params = SmallParams();
  params.tile_size = 32;
  const absl::StatusOr<TileSet> frame = SynthesizeTileSet(material, arrangement, params, RunContext{});
  ASSERT_TRUE(frame.ok()) << frame.status();
  EXPECT_EQ(frame->metadata["method"], "frame");
  EXPECT_FALSE(frame->metadata.contains("diamonds"));
  const double ours = frame->certificate["insides"]["ratio"].get<double>();
  params.seam_rule = SeamRule::kMismatch;
  for (const SynthesisMethod method : {SynthesisMethod::kDiamondDp, SynthesisMethod::kDiamondCut}) {
    params.method = method;
    const absl::StatusOr<TileSet> diamonds = SynthesizeTileSet(material, arrangement, params, RunContext{});
    ASSERT_TRUE(diamonds.ok()) << diamonds.status();
    EXPECT_EQ(diamonds->metadata["method"], SynthesisMethodName(method));
    EXPECT_GT(diamonds->metadata["diamonds"]["draws"].get<int>(), 0);
    EXPECT_GT(diamonds->certificate["insides"]["ratio"].get<double>(), 1.1 * ours);
    EXPECT_TRUE(SerializeTileSet(*diamonds).ok());
  }
}

TEST(SynthesizeTileSetTest, IsCertifiedAgainByItsOwnMaterialOnly) {
  const Material material = MakeMaterial(40, 36, Pattern::kBumps);
  absl::StatusOr<TileSet> set =
      SynthesizeTileSet(material, **FindArrangement("plane-16"), SmallParams(), RunContext{});
  ASSERT_TRUE(set.ok()) << set.status();
  TileSet again = *set;
  again.certificate.clear();
  again.seam_heat.clear();
  ASSERT_TRUE(CertifyTileSet(material, CertificateImages::kStratified, RunContext{}, again).ok());
  EXPECT_EQ(again.certificate, set->certificate);
  EXPECT_EQ(again.seam_heat, set->seam_heat);
  EXPECT_EQ(again.seam_heat.size(), again.tile_index.size());
  Material other = material;
  for (size_t i = 0; i < other.btfels.codes.size(); i += other.btfels.num_coefficients) {
    other.btfels.codes[i] ^= 1;
  }
  const absl::Status refused = CertifyTileSet(other, CertificateImages::kStratified, RunContext{}, again);
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(refused.message()), testing::HasSubstr("BTFel 0"));
  again.source_pixels.clear();
  EXPECT_EQ(CertifyTileSet(material, CertificateImages::kStratified, RunContext{}, again).code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST(SynthesizeTileSetTest, WritesTheSameBytesForAnyNumberOfThreads) {
  const Material material = MakeMaterial(32, 32, Pattern::kBumps);
  std::string one;
  for (const int num_threads : {1, 2, 8}) {
    RunContext context;
    context.num_threads = num_threads;
    const absl::StatusOr<TileSet> set =
        SynthesizeTileSet(material, **FindArrangement("plane-16"), SmallParams(), context);
    ASSERT_TRUE(set.ok()) << set.status();
    const absl::StatusOr<std::string> bytes = SerializeTileSet(*set);
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    if (one.empty()) {
      one = *bytes;
    }
    EXPECT_TRUE(*bytes == one) << num_threads << " threads";
  }
}

TEST(SynthesizeTileSetTest, RefusesToTurnStripesUnlessForced) {
  const Material material = MakeMaterial(32, 32, Pattern::kStripes);
  const Arrangement& surface = **FindArrangement("surface-96");
  SynthesisParams params = SmallParams();
  params.mean_threshold = params.texel_threshold = 100.0;
  const absl::StatusOr<TileSet> refused = SynthesizeTileSet(material, surface, params, RunContext{});
  ASSERT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ReasonOf(refused.status()), "NOT_ISOTROPIC");
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("limit"));
  EXPECT_TRUE(SynthesizeTileSet(material, **FindArrangement("plane-16"), params, RunContext{}).ok());
  params.force = true;
  EXPECT_TRUE(SynthesizeTileSet(material, surface, params, RunContext{}).ok());
}

TEST(SynthesizeTileSetTest, RefusesWhatIsNotAMaterial) {
  Material material = MakeMaterial(32, 32, Pattern::kBumps);
  material.height = 33;
  EXPECT_EQ(
      SynthesizeTileSet(material, **FindArrangement("plane-16"), SmallParams(), RunContext{}).status().code(),
      absl::StatusCode::kInvalidArgument);
  material.height = 32;
  material.btfels.codec_id = "nonesuch";
  EXPECT_THAT(
      std::string(SynthesizeTileSet(material, **FindArrangement("plane-16"), SmallParams(), RunContext{})
                      .status()
                      .message()),
      HasSubstr("nonesuch"));
}

}  // namespace
}  // namespace tessera
