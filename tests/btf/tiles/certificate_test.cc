#include "btf/tiles/certificate.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

// Grey values by pixel, the same in all turns.
ExemplarImage GreyImage(const std::vector<float>& grey) {
  ExemplarImage image;
  for (auto& rgb : image.rgb) {
    for (const float value : grey) {
      rgb.insert(rgb.end(), {value, 0.0f, 0.0f});
    }
  }
  return image;
}

// A verbatim tile and an arrangement without neighbours.
TEST(CertificateTest, IsOneWhereNothingIsCut) {
  const Exemplar exemplar(BumpyEmbedding(12, 10, 1));
  const Arrangement arrangement{.id = "none", .codes = {}, .turned_strips = true, .sha256 = {}};
  IndexMaps maps{.tile_size = 8};
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      maps.texels.push_back(exemplar.TexelAt(1, 1 + x, 2 + y));
    }
  }
  CertificateBuilder builder(exemplar, arrangement, maps);
  builder.Add(GreyImage(std::vector<float>(120, 0.5f)));
  const nlohmann::json certificate = builder.Finish();
  for (const char* const part : {"borders", "insides"}) {
    for (const char* const key : {"ratio", "ratio_p95", "ratio_worst", "ratio_run_p95", "verbatim_share"}) {
      EXPECT_EQ(certificate[part][key], 1.0) << part << " " << key;
    }
    EXPECT_EQ(certificate[part]["cut_share"], 0.0);
  }
  EXPECT_EQ(certificate["insides"]["longest_verbatim_run"], 8);
}

TEST(CertificateTest, MatchesTheDefinitionOnAHandMadeCut) {
  // Exemplar rows are all 0, 1, 3, 6, 10, 15, 21, 28; the tile shows columns 0..3 | 4 columns from 4, moved
  // by one.
  const Exemplar exemplar(BumpyEmbedding(9, 9, 1));
  std::vector<float> grey;
  for (int i = 0; i < 81; ++i) {
    const int x = i % 9;
    grey.push_back(static_cast<float>(x * (x + 1) / 2));
  }
  IndexMaps maps{.tile_size = 8};
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      maps.texels.push_back(exemplar.TexelAt(0, x < 4 ? x : x + 1, y));
    }
  }
  const Arrangement arrangement{.id = "none", .codes = {}, .turned_strips = false, .sha256 = {}};
  CertificateBuilder builder(exemplar, arrangement, maps);
  builder.Add(GreyImage(grey));
  const nlohmann::json insides = builder.Finish()["insides"];
  // a = column 3 (6), b = column 5 (15), a' = column 4 (10), b' = column 4: s = 9, n = (4 + 5) / 2.
  // The exemplar's gradient: 9 rows that rise by 36, over 72 pairs side by side and 72 one above the other.
  const double expected = 9.0 / (4.5 + 0.01 * (9.0 * 36.0 / 144.0));
  EXPECT_NEAR(insides["ratio"].get<double>(), expected, 1e-6);
  EXPECT_NEAR(insides["ratio_run_p95"].get<double>(), expected, 1e-6);
  EXPECT_NEAR(insides["cut_share"].get<double>(), 8.0 / 112.0, 1e-12);
  EXPECT_EQ(insides["longest_verbatim_run"], 8);
}

TEST(CertificateTest, SeesCutsAcrossTheBordersOfLegalPairs) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 3));
  SynthesisParams params;
  params.tile_size = 16;
  params.strip_height = 8;
  params.mean_threshold = params.texel_threshold = 10.0;
  const Arrangement& arrangement = **FindArrangement("plane-16");
  const absl::StatusOr<IndexMaps> maps = SynthesizeIndexMaps(exemplar, arrangement, params, RunContext{});
  ASSERT_TRUE(maps.ok()) << maps.status();
  ExemplarImage image;
  for (int turn = 0; turn < 4; ++turn) {
    for (int pixel = 0; pixel < 1600; ++pixel) {
      const float* const point = exemplar.Point(PackTexel(static_cast<uint32_t>(pixel), turn));
      image.rgb[turn].insert(image.rgb[turn].end(), {point[0], point[1], point[2]});
    }
  }
  const auto border_ratio = [&](const IndexMaps& tiles) {
    CertificateBuilder builder(exemplar, arrangement, tiles);
    builder.Add(image);
    return builder.Finish()["borders"];
  };
  const nlohmann::json sound = border_ratio(*maps);
  EXPECT_LT(sound["cut_share"].get<double>(), 0.6);
  // Texels drawn at random break every border.
  IndexMaps broken = *maps;
  Rng rng(1);
  for (uint32_t& texel : broken.texels) {
    texel = PackTexel(static_cast<uint32_t>(rng.NextBelow(1600)), 0);
  }
  EXPECT_GT(border_ratio(broken)["cut_share"].get<double>(), 0.95);
  EXPECT_GT(border_ratio(broken)["ratio"].get<double>(), 1.5);
}

}  // namespace
}  // namespace tessera
