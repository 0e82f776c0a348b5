// The embedding of decoded reflectance against integrals by brute force.
#include <algorithm>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/embedding.h"
#include "btf/math/hemisphere_gram.h"
#include "tests/btf/codec/synthetic_btf.h"

namespace tessera {
namespace {

Material ShinyMaterial(int width, int height) {
  SampledBtf btf = ShinyBtf(width, height, RingDirections(5, 12), RingDirections(5, 12));
  return *FindCodec("dsh-cls")->Encode(btf, {.kl = 16, .kv = 16, .cls_energy = ClsEnergy::kSphere}, {});
}

// A texel of the exemplar as it looks turned.
struct Texel {
  int x = 0;
  int y = 0;
  int turns = 0;
};

double SquaredDistance(const Embedding& embedding, const Texel& a, const Texel& b) {
  const float* const p = embedding.at(a.turns, a.x, a.y);
  const float* const q = embedding.at(b.turns, b.x, b.y);
  double sum = 0.0;
  for (int i = 0; i < embedding.dims; ++i) {
    sum += (static_cast<double>(p[i]) - q[i]) * (static_cast<double>(p[i]) - q[i]);
  }
  return sum;
}

// The squared differences of pairs, integrated over both hemispheres by a dense product rule.
std::vector<double> Integrals(const Material& material,
                              const std::vector<std::pair<Texel, Texel>>& texel_pairs) {
  const auto decoder = MakeDecoder(material.btfels);
  constexpr int kPolarAngles = 8;
  constexpr int kAzimuths = 20;
  const GaussLegendreRule polar = GaussLegendre(kPolarAngles);
  HemisphereQuadrature rule{Eigen::Matrix3Xd(3, kPolarAngles * kAzimuths),
                            Eigen::VectorXd(kPolarAngles * kAzimuths)};
  for (int i = 0; i < kPolarAngles * kAzimuths; ++i) {
    rule.directions.col(i) =
        VectorFromDirection({std::acos(polar.nodes[i / kAzimuths]), 2.0 * kPi * (i % kAzimuths) / kAzimuths});
    rule.weights[i] = polar.weights[i / kAzimuths] * 2.0 * kPi / kAzimuths;
  }
  std::vector<double> integrals(texel_pairs.size(), 0.0);
  std::array<std::vector<float>, 4> rgb;
  for (Eigen::Index l = 0; l < rule.weights.size(); ++l) {
    for (Eigen::Index v = 0; v < rule.weights.size(); ++v) {
      for (int turns = 0; turns < 4; ++turns) {
        rgb[turns].resize(material.btfels.size() * 3);
        (*decoder)->DecodeTexels(material.btfels.codes, rule.directions.col(l), rule.directions.col(v), turns,
                                 rgb[turns]);
      }
      for (size_t i = 0; i < texel_pairs.size(); ++i) {
        const auto& [a, b] = texel_pairs[i];
        double mean = 0.0;
        for (int channel = 0; channel < 3; ++channel) {
          const double difference = rgb[a.turns][3 * (a.y * material.width + a.x) + channel] -
                                    rgb[b.turns][3 * (b.y * material.width + b.x) + channel];
          mean += difference * difference / 3.0;
        }
        integrals[i] += rule.weights[l] * rule.weights[v] * mean;
      }
    }
  }
  return integrals;
}

std::vector<double> Ranks(const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::sort(order, [&](size_t a, size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (size_t i = 0; i < order.size(); ++i) {
    ranks[order[i]] = static_cast<double>(i);
  }
  return ranks;
}

double RankCorrelation(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> ra = Ranks(a);
  const std::vector<double> rb = Ranks(b);
  double sum = 0.0;
  for (size_t i = 0; i < a.size(); ++i) {
    sum += (ra[i] - rb[i]) * (ra[i] - rb[i]);
  }
  const double n = static_cast<double>(a.size());
  return 1.0 - 6.0 * sum / (n * (n * n - 1.0));
}

TEST(DecodedEmbeddingTest, DistanceIsTheIntegratedSquaredDifference) {
  const Material material = ShinyMaterial(8, 6);
  std::vector<std::pair<Texel, Texel>> pairs;
  Rng rng(3);
  const auto texel = [&] {
    return Texel{static_cast<int>(rng.NextBelow(8)), static_cast<int>(rng.NextBelow(6)),
                 static_cast<int>(rng.NextBelow(4))};
  };
  while (pairs.size() < 100) {
    const Texel a = texel();
    const Texel b = texel();
    if (a.x != b.x || a.y != b.y) {
      pairs.emplace_back(a, b);
    }
  }
  const std::vector<double> expected = Integrals(material, pairs);
  const auto embedding = EmbedDecoded(material, 64, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  std::vector<double> distances;
  double mean_log_ratio = 0.0;
  for (size_t i = 0; i < pairs.size(); ++i) {
    distances.push_back(SquaredDistance(*embedding, pairs[i].first, pairs[i].second));
    const double log_ratio = std::log(distances[i] / expected[i]);
    mean_log_ratio += log_ratio / static_cast<double>(pairs.size());
    // 3 polar angles do not see where clamping at 75 degrees begins; measured 0.06.
    EXPECT_LT(std::abs(log_ratio), 0.08) << "pair " << i;
  }
  EXPECT_LT(std::abs(mean_log_ratio), 0.03);
  EXPECT_GT(RankCorrelation(distances, expected), 0.999);
}

TEST(DecodedEmbeddingTest, TurningIsConsistent) {
  // A texel whose material is the turned one's: same values under the same pair, so the same point.
  SampledBtf btf = ShinyBtf(6, 5, RingDirections(4, 8), RingDirections(4, 8));
  SampledBtf turned(6, 5, btf.info().views, btf.info().lights);
  const auto before = [](size_t i) {  // the ring's direction a quarter turn back
    return i == 0 ? size_t{0} : (i - 1) / 8 * 8 + ((i - 1) % 8 + 6) % 8 + 1;
  };
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 6; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        for (size_t v = 0; v < btf.info().views.size(); ++v) {
          for (size_t l = 0; l < btf.info().lights.size(); ++l) {
            turned.at(x, y, channel, v, l) = btf.at(x, y, channel, before(v), before(l));
          }
        }
      }
    }
  }
  SampledBtf both(6, 10, btf.info().views, btf.info().lights);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 6; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        for (size_t v = 0; v < btf.info().views.size(); ++v) {
          for (size_t l = 0; l < btf.info().lights.size(); ++l) {
            both.at(x, y, channel, v, l) =
                y < 5 ? btf.at(x, y, channel, v, l) : turned.at(x, y - 5, channel, v, l);
          }
        }
      }
    }
  }
  const auto material =
      FindCodec("dsh-cls")->Encode(both, {.kl = 9, .kv = 9, .cls_energy = ClsEnergy::kSphere}, {});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto embedding = EmbedDecoded(*material, 24, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  double spread = 0.0;
  for (const double variance : embedding->variance) {
    spread += variance;
  }
  for (int turns = 0; turns < 4; ++turns) {
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < 6; ++x) {
        // Quantised apart: a step is 1/255 of a coefficient's range.
        EXPECT_LT(SquaredDistance(*embedding, {x, y, (turns + 1) % 4}, {x, y + 5, turns}), 1e-3 * spread);
      }
    }
  }
}

TEST(DecodedEmbeddingTest, ComponentsAreCentredAndHaveTheVarianceTheyState) {
  const Material material = ShinyMaterial(16, 12);
  constexpr int kDims = 6;
  const auto embedding = EmbedDecoded(material, kDims, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  const int count = 4 * 16 * 12;
  for (int i = 0; i < kDims; ++i) {
    double sum = 0.0;
    double sum_of_squares = 0.0;
    for (int n = 0; n < count; ++n) {
      const double value = embedding->values[n * kDims + i];
      sum += value;
      sum_of_squares += value * value;
    }
    const double variance = sum_of_squares / count;
    EXPECT_NEAR(sum / count, 0.0, 1e-5 * std::sqrt(variance));
    EXPECT_NEAR(variance, embedding->variance[i], 1e-4 * variance);
  }
}

TEST(DecodedEmbeddingTest, DoesNotDependOnThreads) {
  const Material material = ShinyMaterial(20, 15);
  RunContext one;
  one.num_threads = 1;
  const auto reference = EmbedDecoded(material, 12, one);
  ASSERT_TRUE(reference.ok());
  for (const int threads : {2, 8}) {
    RunContext many;
    many.num_threads = threads;
    const auto embedding = EmbedDecoded(material, 12, many);
    ASSERT_TRUE(embedding.ok());
    EXPECT_EQ(embedding->values, reference->values);
    EXPECT_EQ(embedding->variance, reference->variance);
  }
}

TEST(DecodedEmbeddingTest, RefusesNonsense) {
  Material material = ShinyMaterial(2, 2);
  EXPECT_EQ(EmbedDecoded(material, 0, {}).status().code(), absl::StatusCode::kInvalidArgument);
  material.btfels.codec_id = "nonesuch";
  EXPECT_EQ(EmbedDecoded(material, 4, {}).status().code(), absl::StatusCode::kUnimplemented);
  material.btfels.codec_id = "dsh-cls";
  material.width = 3;
  EXPECT_EQ(EmbedDecoded(material, 4, {}).status().code(), absl::StatusCode::kInvalidArgument);
  material.width = 2;
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  EXPECT_EQ(EmbedDecoded(material, 4, context).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
