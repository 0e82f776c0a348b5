#include "btf/tiles/certificate.h"

#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "btf/tiles/repetition.h"
#include "btf/tiles/seam_controls.h"
#include "btf/tiles/tile_sides.h"
#include "tests/btf/tiles/noise_exemplar.h"
#include "tests/btf/wang/turned_tiles.h"

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

// The first three dimensions of the embedding as red, green and blue.
ExemplarImage ImageOf(const Exemplar& exemplar) {
  ExemplarImage image;
  for (int turn = 0; turn < 4; ++turn) {
    for (int pixel = 0; pixel < exemplar.num_pixels(); ++pixel) {
      const float* const point = exemplar.Point(PackTexel(static_cast<uint32_t>(pixel), turn));
      image.rgb[turn].insert(image.rgb[turn].end(), {point[0], point[1], point[2]});
    }
  }
  return image;
}

double RatioOf(const Exemplar& exemplar, const Seams& seams) {
  SeamMeter meter(exemplar, seams);
  meter.Add(std::vector{ImageOf(exemplar)}, RunContext{});
  return meter.Ratio();
}

IndexMaps Synthesized(const Exemplar& exemplar, const Arrangement& arrangement) {
  SynthesisParams params;
  params.tile_size = 16;
  params.strip_height = 8;
  params.mean_threshold = params.texel_threshold = 10.0;
  const absl::StatusOr<IndexMaps> maps = SynthesizeIndexMaps(exemplar, arrangement, params, RunContext{});
  EXPECT_TRUE(maps.ok()) << maps.status();
  return *maps;
}

TEST(CertificateTest, ImagesAreSpreadOverAllViewsAndLights) {
  const std::vector<ImagePair> images = ChooseImages(81, 81, CertificateImages::kStratified);
  ASSERT_EQ(images.size(), 256u);
  for (size_t i = 0; i < images.size(); ++i) {
    EXPECT_EQ((images[i].view * 16 + 15) / 81, static_cast<int>(i) / 16);
    EXPECT_EQ((images[i].light * 16 + 15) / 81, static_cast<int>(i) % 16);
  }
  EXPECT_EQ(ChooseImages(81, 81, CertificateImages::kAll).size(), 6561u);
  EXPECT_EQ(ChooseImages(3, 5, CertificateImages::kStratified).size(), 15u);
  // Few views: more lights for each.
  EXPECT_GE(ChooseImages(2, 500, CertificateImages::kStratified).size(), 256u);
  std::set<std::pair<int, int>> different;
  for (const ImagePair& image : ChooseImages(4, 300, CertificateImages::kStratified)) {
    EXPECT_TRUE(image.view >= 0 && image.view < 4 && image.light >= 0 && image.light < 300);
    different.insert({image.view, image.light});
  }
  EXPECT_EQ(different.size(), 256u);
}

// A verbatim tile.
TEST(CertificateTest, IsOneWhereNothingIsCut) {
  const Exemplar exemplar(BumpyEmbedding(12, 10, 1));
  IndexMaps maps{.tile_size = 8};
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 8; ++x) {
      maps.texels.push_back(exemplar.TexelAt(1, 1 + x, 2 + y));
    }
  }
  SeamMeter meter(exemplar, InsideSeams(exemplar, maps));
  meter.Add(std::vector{GreyImage(std::vector<float>(120, 0.5f))}, RunContext{});
  const nlohmann::json insides = meter.Describe();
  for (const char* const key : {"ratio", "ratio_p95", "ratio_worst", "ratio_run_p95", "verbatim_share"}) {
    EXPECT_EQ(insides[key], 1.0) << key;
  }
  EXPECT_EQ(insides["cut_share"], 0.0);
  EXPECT_EQ(insides["longest_verbatim_run"], 8);
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
  const Seams seams = InsideSeams(exemplar, maps);
  SeamMeter meter(exemplar, seams);
  meter.Add(std::vector{GreyImage(grey)}, RunContext{});
  const nlohmann::json insides = meter.Describe();
  // a = column 3 (6), b = column 5 (15), a' = column 4 (10), b' = column 4: s = 9, n = (4 + 5) / 2.
  // The exemplar's gradient: 9 rows that rise by 36, over 72 pairs side by side and 72 one above the other.
  const double epsilon = 0.01 * (9.0 * 36.0 / 144.0);
  const double expected = (9.0 + epsilon) / (4.5 + epsilon);
  EXPECT_NEAR(insides["ratio"].get<double>(), expected, 1e-6);
  EXPECT_NEAR(insides["ratio_run_p95"].get<double>(), expected, 1e-6);
  EXPECT_NEAR(insides["cut_share"].get<double>(), 8.0 / 112.0, 1e-12);
  EXPECT_EQ(insides["longest_verbatim_run"], 8);
  // The two columns beside the cut, and nothing else.
  std::set<uint32_t> touched;
  for (const auto& [pair, texel] : seams.places) {
    touched.insert(texel);
  }
  std::set<uint32_t> beside;
  for (uint32_t y = 0; y < 8; ++y) {
    beside.insert({8 * y + 3, 8 * y + 4});
  }
  EXPECT_EQ(touched, beside);
}

TEST(CertificateTest, SeesCutsAcrossTheBordersOfLegalPairs) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 3));
  const Arrangement& arrangement = **FindArrangement("plane-16");
  const IndexMaps maps = Synthesized(exemplar, arrangement);
  const auto border_figures = [&](const IndexMaps& tiles) {
    SeamMeter meter(exemplar, BorderSeams(exemplar, arrangement, tiles));
    meter.Add(std::vector{ImageOf(exemplar)}, RunContext{});
    return meter.Describe();
  };
  EXPECT_LT(border_figures(maps)["cut_share"].get<double>(), 0.6);
  // Texels drawn at random break every border.
  IndexMaps broken = maps;
  Rng rng(1);
  for (uint32_t& texel : broken.texels) {
    texel = PackTexel(static_cast<uint32_t>(rng.NextBelow(1600)), 0);
  }
  EXPECT_GT(border_figures(broken)["cut_share"].get<double>(), 0.95);
  EXPECT_GT(border_figures(broken)["ratio"].get<double>(), 1.5);
}

TEST(CertificateTest, LooksAcrossEveryLegalPairOfEveryArrangement) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 3));
  for (const Arrangement& arrangement : BuiltinArrangements()) {
    // One texel everywhere: what counts is how many pairs there are, and that turned tiles are seen turned.
    IndexMaps maps{.tile_size = 4};
    for (size_t tile = 0; tile < arrangement.codes.size(); ++tile) {
      const TileSides sides = arrangement.SidesOf(tile);
      for (int i = 0; i < 16; ++i) {
        maps.texels.push_back(PackTexel(41, 0));
      }
      for (int side = 0; side < 4; ++side) {
        for (int along = 1; along < 3; ++along) {
          const auto [x, y] = TilePixelAt(side, along, 0, 4);
          const StripTexel at = StripTexelAt(side, sides[side].sign, along, 0, 4, 2);
          const int own_turns = TurnsOfStrip(arrangement, StripOfSide(arrangement, side, 0))[0];
          maps.texels[tile * 16 + y * 4 + x] =
              TurnTexel(exemplar.TexelAt(own_turns, 10 + at.x, 10 + at.y), at.turns);
        }
      }
    }
    const Seams seams = BorderSeams(exemplar, arrangement, maps);
    double legal = 0.0;
    for (size_t a = 0; a < arrangement.codes.size(); ++a) {
      for (size_t b = 0; b < arrangement.codes.size(); ++b) {
        for (int k = 0; k < 4; ++k) {
          for (int j = 0; j < 4; ++j) {
            const bool may_face = arrangement.turned_strips || (j - k + 4) % 4 == 2;
            const TileSide side = arrangement.SidesOf(a)[k];
            legal += side.sign == Sign::kPlus && may_face && SidesMatch(side, arrangement.SidesOf(b)[j]);
          }
        }
      }
    }
    EXPECT_EQ(seams.num_pairs, 4 * legal) << arrangement.id;
    // Inner texels go on across the border, ends do not.
    const double inner = std::accumulate(seams.pairs.begin(), seams.pairs.end(), 0.0,
                                         [](double sum, const CutPair& pair) { return sum + pair.weight; });
    EXPECT_EQ(inner, 2 * legal) << arrangement.id;
  }
}

TEST(CertificateTest, ControlsScoreAsTheyMust) {
  const Exemplar exemplar(BumpyEmbedding(64, 64, 3));
  EXPECT_EQ(RatioOf(exemplar, FalseCuts(exemplar, 8)), 1.0);
  for (const std::vector<int>& turns : {std::vector<int>{0}, std::vector<int>{0, 1, 2, 3}}) {
    const RandomJoins joins = JoinAtRandom(exemplar, turns, 8);
    const double minimum = RatioOf(exemplar, joins.minimum_cuts);
    const double straight = RatioOf(exemplar, joins.straight_cuts);
    EXPECT_GT(minimum, 1.1);
    EXPECT_GT(straight, minimum + 0.2);
  }
  const double synthesized =
      RatioOf(exemplar, InsideSeams(exemplar, Synthesized(exemplar, **FindArrangement("plane-16"))));
  EXPECT_LT(synthesized, RatioOf(exemplar, JoinAtRandom(exemplar, {0}, 8).minimum_cuts));
}

TEST(CertificateTest, DoesNotDependOnThreads) {
  const Exemplar exemplar(BumpyEmbedding(40, 40, 5));
  const Seams seams = JoinAtRandom(exemplar, {0}, 8).minimum_cuts;
  const std::vector<ExemplarImage> images(3, ImageOf(exemplar));
  std::string first;
  for (const int threads : {1, 2, 8}) {
    RunContext context;
    context.num_threads = threads;
    SeamMeter meter(exemplar, seams);
    meter.Add(images, context);
    const std::string text = meter.Describe().dump();
    EXPECT_EQ(text, first.empty() ? text : first);
    first = text;
  }
}

TEST(RepetitionTest, TellsOneTileEverywhereFromManyTiles) {
  const Exemplar exemplar(BumpyEmbedding(64, 64, 3));
  const Arrangement& arrangement = **FindArrangement("plane-16");
  const IndexMaps maps = Synthesized(exemplar, arrangement);
  IndexMaps same = maps;
  for (size_t i = 256; i < same.texels.size(); ++i) {
    same.texels[i] = same.texels[i % 256];
  }
  const absl::StatusOr<nlohmann::json> many = MeasureRepetition(exemplar, arrangement, maps, 8, RunContext{});
  const absl::StatusOr<nlohmann::json> one = MeasureRepetition(exemplar, arrangement, same, 8, RunContext{});
  ASSERT_TRUE(many.ok() && one.ok()) << many.status() << one.status();
  EXPECT_NEAR((*one)["plane_peak"].get<double>(), 1.0, 1e-3);
  EXPECT_LT((*many)["plane_peak"].get<double>(), 0.7);
  EXPECT_EQ((*many)["exemplar_peak"], (*one)["exemplar_peak"]);
}

TEST(RepetitionTest, SeesTurnedTilesAsTheyAreLaid) {
  const Exemplar exemplar(BumpyEmbedding(64, 64, 4));
  IndexMaps maps = Synthesized(exemplar, **FindArrangement("surface-26"));
  const auto few = MeasureRepetition(exemplar, **FindArrangement("surface-26"), maps, 8, RunContext{});
  maps.texels = Surface96FromSurface26(maps.texels, maps.tile_size);
  const auto all = MeasureRepetition(exemplar, **FindArrangement("surface-96"), maps, 8, RunContext{});
  ASSERT_TRUE(few.ok() && all.ok()) << few.status() << all.status();
  EXPECT_EQ(*few, *all);
}

}  // namespace
}  // namespace tessera
