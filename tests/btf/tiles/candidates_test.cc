#include "btf/tiles/candidates.h"

#include <algorithm>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/btf/tiles/noise_exemplar.h"

namespace tessera {
namespace {

// Float transforms of values of order 1.
constexpr double kTransformTolerance = 1e-4;

SearchQuery RandomQuery(const Exemplar& exemplar, Rng& rng) {
  SearchQuery query{.width = 5, .height = 4, .weights = {}, .wanted = {}};
  for (int i = 0; i < 20; ++i) {
    query.weights.push_back(rng.NextBelow(3) == 0 ? 0.0f : static_cast<float>(rng.NextDouble()));
    for (int dim = 0; dim < exemplar.search_dims(); ++dim) {
      query.wanted.push_back(static_cast<float>(rng.NextDouble() - 0.5));
    }
  }
  return query;
}

double BruteForce(const Exemplar& exemplar, const SearchQuery& query, const Patch& patch) {
  double cost = 0.0;
  double weights = 0.0;
  for (int i = 0; i < 20; ++i) {
    const float* const point = exemplar.Point(exemplar.TexelAt(patch.turn, patch.u + i % 5, patch.v + i / 5));
    weights += query.weights[i];
    for (int dim = 0; dim < exemplar.search_dims(); ++dim) {
      const double difference = query.wanted[i * exemplar.search_dims() + dim] - point[dim];
      cost += query.weights[i] * difference * difference;
    }
  }
  return cost / weights / exemplar.search_spread();
}

// In one region, and in two that have a window's width in common.
TEST(CandidateSearchTest, FindsTheBestOffsetsOfAllTurns) {
  const Exemplar exemplar(BumpyEmbedding(21, 14, 8));
  const std::vector<int> turns = {0, 1, 2, 3};
  for (const auto& [side, num_regions] : {std::pair(21, 1), std::pair(14, 2)}) {
    const ExemplarSpectra spectra(exemplar, turns, side, RunContext{});
    ASSERT_EQ(spectra.num_regions(), num_regions);
    EXPECT_EQ(spectra.shorter_side(), 14);
    CandidateSearch search(spectra);
    Rng rng(4);
    for (int round = 0; round < 20; ++round) {
      const SearchQuery query = RandomQuery(exemplar, rng);
      double best = 1e9;
      for (const int turn : turns) {
        for (int v = 0; v + 4 <= exemplar.TurnedHeight(turn); ++v) {
          for (int u = 0; u + 5 <= exemplar.TurnedWidth(turn); ++u) {
            best = std::min(best, BruteForce(exemplar, query, {turn, u, v}));
          }
        }
      }
      double best_found = 1e9;
      for (int region = 0; region < num_regions; ++region) {
        const std::vector<Candidate> found = search.Search(query, region, turns, nullptr, 0.0, 6, 1, {});
        ASSERT_EQ(found.size(), 6u);
        best_found = std::min(best_found, found.front().cost);
        for (size_t i = 0; i < found.size(); ++i) {
          EXPECT_NEAR(found[i].cost, BruteForce(exemplar, query, found[i].patch), kTransformTolerance);
          for (size_t j = 0; j < i; ++j) {
            EXPECT_LE(found[j].cost, found[i].cost);
            EXPECT_TRUE(found[i].patch.turn != found[j].patch.turn ||
                        std::abs(found[i].patch.u - found[j].patch.u) > 1 ||
                        std::abs(found[i].patch.v - found[j].patch.v) > 1);
          }
        }
      }
      EXPECT_NEAR(best_found, best, kTransformTolerance);
    }
  }
}

TEST(ExemplarSpectraTest, RegionsAreDrawnFromAll) {
  const Exemplar exemplar(BumpyEmbedding(40, 21, 8));
  const ExemplarSpectra spectra(exemplar, {0}, 16, RunContext{});
  ASSERT_EQ(spectra.num_regions(), 6);
  Rng rng(1);
  std::vector<int> draws(6, 0);
  for (int draw = 0; draw < 60; ++draw) {
    ++draws[spectra.DrawRegion(rng)];
  }
  EXPECT_GT(*std::ranges::min_element(draws), 0);
}

TEST(UsageMapTest, CountsTheRectangleOfATurnedPatch) {
  const Exemplar exemplar(BumpyEmbedding(9, 6, 8));
  UsageMap usage(9, 6);
  EXPECT_EQ(usage.RelativeUse({0, 0, 0}, 3, 2), 0.0);
  for (int turn = 0; turn < 4; ++turn) {
    // Count one patch, then look for it in every turn.
    UsageMap once(9, 6);
    std::vector<uint32_t> texels;
    for (int i = 0; i < 6; ++i) {
      texels.push_back(exemplar.TexelAt(turn, 1 + i % 3, 2 + i / 3));
    }
    once.Count(texels);
    once.Finish();
    const Patch patch{turn, 1, 2};
    EXPECT_DOUBLE_EQ(once.RelativeUse(patch, 3, 2), 9.0) << turn;  // all 6 uses, on 6 of 54 pixels
    EXPECT_LT(once.RelativeUse({turn, 0, 2}, 3, 2), 9.0);
  }
}

TEST(SampleCandidatesTest, DrawsWithoutReplacementAndFavoursTheBest) {
  std::vector<Candidate> candidates;
  for (int i = 0; i < 10; ++i) {
    candidates.push_back({{0, i, 0}, 1.0 + 0.05 * i});
  }
  Rng rng(3);
  int best_first = 0;
  for (int round = 0; round < 500; ++round) {
    const std::vector<Candidate> drawn = SampleCandidates(candidates, 4, 0.1, rng);
    ASSERT_EQ(drawn.size(), 4u);
    best_first += drawn[0].patch.u == 0 ? 1 : 0;
    for (size_t i = 0; i < 4; ++i) {
      for (size_t j = 0; j < i; ++j) {
        EXPECT_NE(drawn[i].patch.u, drawn[j].patch.u);
      }
    }
  }
  EXPECT_GT(best_first, 120);  // about 1 - exp(-1/2) = 0.39 of 500
  EXPECT_LT(best_first, 300);
}

}  // namespace
}  // namespace tessera
