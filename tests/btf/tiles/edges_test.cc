#include "btf/tiles/edges.h"

#include <tuple>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

constexpr int kEdgeTile = 32;
constexpr int kStripSide = 8;

class SynthesizeEdgesTest : public testing::Test {
 protected:
  Edges Synthesize(const std::vector<Corners>& sets) {
    const FillParams params{.turns = {}, .feature_size = kStripSide, .seed = 5, .num_candidates = 4};
    auto edges = SynthesizeEdges(spectra_, arrangement_, sets, {}, kEdgeTile, params, {});
    EXPECT_TRUE(edges.ok()) << edges.status();
    return *std::move(edges);
  }

  Exemplar exemplar_{BumpyEmbedding(80, 72, 1)};
  ExemplarSpectra spectra_{exemplar_, {0, 1, 2, 3}, RegionSide(exemplar_, kStripSide), RunContext{}};
  const Arrangement& arrangement_ = **FindArrangement("surface-26");
  std::vector<Corners> sets_ = *ChooseCorners(spectra_, arrangement_, kStripSide, 3, RunContext{});
};

TEST_F(SynthesizeEdgesTest, EveryStripEndsInItsSamples) {
  const Edges edges = Synthesize(sets_);
  ASSERT_EQ(edges.strips.size(), static_cast<size_t>(NumStrips(arrangement_)));
  for (int strip = 0; strip < NumStrips(arrangement_); ++strip) {
    const Patch& start = edges.corners.sample(strip, StripEnd::kStart);
    const Patch& end = edges.corners.sample(strip, StripEnd::kEnd);
    for (int y = 0; y < kStripSide; ++y) {
      for (int x = 0; x < kStripSide / 2; ++x) {
        EXPECT_EQ(edges.strips[strip].texel(x, y), exemplar_.TexelAt(start.turn, start.u + x, start.v + y));
        EXPECT_EQ(edges.strips[strip].texel(kEdgeTile - kStripSide / 2 + x, y),
                  exemplar_.TexelAt(end.turn, end.u + x, end.v + y));
      }
    }
  }
}

// Strips are made for both sets, and whichever corners cost too much are not taken.
TEST_F(SynthesizeEdgesTest, KeepsTheSetThatCostsLeastInAll) {
  for (const size_t dear : {0, 1}) {
    std::vector<Corners> sets = {sets_[0], sets_[1]};
    sets[dear].cost = 1000.0;
    const Patch taken = Synthesize(sets).corners.samples[0];
    const Patch expected = sets[1 - dear].samples[0];
    EXPECT_EQ(std::tuple(taken.turn, taken.u, taken.v), std::tuple(expected.turn, expected.u, expected.v));
  }
}

TEST_F(SynthesizeEdgesTest, TriesFindCheaperStripsThanOne) {
  const Edges edges = Synthesize({sets_[0]});
  double cost = 0.0;
  double cost_of_one = 0.0;
  for (int strip = 0; strip < NumStrips(arrangement_); ++strip) {
    FillParams params{.turns = {}, .feature_size = kStripSide, .seed = 6, .num_candidates = 4};
    params.turns = TurnsOfStrip(arrangement_, strip);
    Strip one;
    ASSERT_TRUE(SynthesizeStrip(spectra_, sets_[0], {}, strip, kEdgeTile, params, RunContext{}, one).ok());
    cost_of_one += static_cast<double>(one.cost);
    cost += static_cast<double>(edges.strips[strip].cost);
  }
  EXPECT_LT(cost, cost_of_one);
}

}  // namespace
}  // namespace tessera
