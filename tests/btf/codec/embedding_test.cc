// The embedding of "dsh-cls" against integrals by brute force.
#include <cmath>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/embedding.h"
#include "btf/math/hemisphere_gram.h"
#include "tests/btf/codec/synthetic_btf.h"

namespace tessera {
namespace {

Material ShinyMaterial(int width, int height, int kl, int kv) {
  SampledBtf btf = ShinyBtf(width, height, RingDirections(4, 9), RingDirections(4, 9, 60.0));
  return *FindCodec("dsh-cls")->Encode(btf, {.kl = kl, .kv = kv, .cls_energy = ClsEnergy::kSphere}, {});
}

double SquaredDistance(const float* a, const float* b, int dims) {
  double sum = 0.0;
  for (int i = 0; i < dims; ++i) {
    sum += (static_cast<double>(a[i]) - b[i]) * (static_cast<double>(a[i]) - b[i]);
  }
  return sum;
}

TEST(EmbeddingTest, DistanceIsTheIntegratedSquaredDifference) {
  const Material material = ShinyMaterial(3, 2, 9, 4);
  const int k = material.btfels.num_coefficients;
  const auto embedding = FindCodec("dsh-cls")->Embed(material, k, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  ASSERT_EQ(embedding->dims, k);
  const auto decoder = MakeDecoder(material.btfels);
  ASSERT_TRUE(decoder.ok());
  const HemisphereQuadrature lights = MakeHemisphereQuadrature(3, RadFromDeg(60.0));
  const HemisphereQuadrature views = MakeHemisphereQuadrature(3, RadFromDeg(75.0));
  struct Texel {
    int x, y, turns;
  };
  const Texel pairs[][2] = {
      {{0, 0, 0}, {1, 0, 0}}, {{2, 1, 1}, {0, 1, 0}}, {{1, 1, 3}, {1, 1, 0}}, {{2, 0, 2}, {0, 0, 1}}};
  for (const auto& [a, b] : pairs) {
    std::vector<double> ca(k);
    std::vector<double> cb(k);
    (*decoder)->Dequantize(material.btfels.btfel(a.y * 3 + a.x), ca);
    (*decoder)->Dequantize(material.btfels.btfel(b.y * 3 + b.x), cb);
    double integral = 0.0;
    for (Eigen::Index l = 0; l < lights.weights.size(); ++l) {
      for (Eigen::Index v = 0; v < views.weights.size(); ++v) {
        const Eigen::Vector3d light = lights.directions.col(l);
        const Eigen::Vector3d view = views.directions.col(v);
        const Eigen::Array3d difference =
            (*decoder)->Evaluate(ca, UnturnedFromTurned(light, a.turns), UnturnedFromTurned(view, a.turns)) -
            (*decoder)->Evaluate(cb, UnturnedFromTurned(light, b.turns), UnturnedFromTurned(view, b.turns));
        integral += lights.weights[l] * views.weights[v] * difference.square().mean();
      }
    }
    const double distance =
        SquaredDistance(embedding->at(a.turns, a.x, a.y), embedding->at(b.turns, b.x, b.y), k);
    // The embedding is stored in float.
    EXPECT_NEAR(distance, integral, 1e-4 * integral) << "turns " << a.turns << " " << b.turns;
  }
}

TEST(EmbeddingTest, DistanceOfImagesIsTheirWeightedDifferenceInAllTurns) {
  const Material material = ShinyMaterial(3, 2, 9, 4);
  const auto direction = [](double theta_deg, double phi_deg) {
    return VectorFromDirection({.theta_rad = RadFromDeg(theta_deg), .phi_rad = RadFromDeg(phi_deg)});
  };
  const std::vector<WeightedImage> images = {{direction(30, 10), direction(55, 100), 2.0},
                                             {direction(50, 200), direction(20, 310), 0.5}};
  const auto embedding = EmbedImages(material, images, 100, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  ASSERT_EQ(embedding->dims, 24);
  const auto decoder = MakeDecoder(material.btfels);
  ASSERT_TRUE(decoder.ok());
  for (const int turns_of_a : {0, 1, 3}) {
    double sum = 0.0;
    for (const WeightedImage& image : images) {
      for (int turns = 0; turns < 4; ++turns) {
        const auto seen = [&](int texel, int own_turns) {
          return (*decoder)->Decode(material.btfels.btfel(texel), image.light, image.view, turns + own_turns);
        };
        sum += image.weight * image.weight * (seen(4, turns_of_a) - seen(2, 2)).square().sum();
      }
    }
    const double distance = SquaredDistance(embedding->at(turns_of_a, 1, 1), embedding->at(2, 2, 0), 24);
    EXPECT_NEAR(distance, sum, 1e-4 * sum) << turns_of_a;
  }
}

TEST(EmbeddingTest, ComponentsAreCentredAndHaveTheVarianceTheyState) {
  const Material material = ShinyMaterial(16, 12, 9, 9);
  constexpr int kDims = 6;
  const auto embedding = FindCodec("dsh-cls")->Embed(material, kDims, {});
  ASSERT_TRUE(embedding.ok()) << embedding.status();
  const int count = 4 * 16 * 12;
  double captured = 0.0;
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
    if (i > 0) {
      EXPECT_LE(embedding->variance[i], embedding->variance[i - 1] * (1.0 + 1e-9));
    }
    captured += embedding->variance[i];
  }
  EXPECT_LT(captured, embedding->total_variance);
  EXPECT_GT(captured, 0.5 * embedding->total_variance);
}

TEST(EmbeddingTest, IterationFindsTheLeadingComponents) {
  // 243 coefficients: a few components are found by iteration, all of them directly.
  const Material material = ShinyMaterial(16, 12, 9, 9);
  const auto few = FindCodec("dsh-cls")->Embed(material, 8, {});
  const auto all = FindCodec("dsh-cls")->Embed(material, 1000, {});
  ASSERT_TRUE(few.ok() && all.ok());
  EXPECT_EQ(all->dims, 243);
  EXPECT_DOUBLE_EQ(few->total_variance, all->total_variance);
  double total = 0.0;
  for (const double variance : all->variance) {
    total += variance;
  }
  EXPECT_NEAR(total, all->total_variance, 1e-9 * total);
  for (int i = 0; i < 8; ++i) {
    EXPECT_NEAR(few->variance[i], all->variance[i], 1e-5 * all->variance[i]);
  }
  // A prefix of the complete embedding is as good as the small one.
  double error = 0.0;
  double scale = 0.0;
  for (int x = 1; x < 16; ++x) {
    const double a = SquaredDistance(few->at(1, x, 3), few->at(0, 0, 3), 8);
    const double b = SquaredDistance(all->at(1, x, 3), all->at(0, 0, 3), 8);
    error += std::abs(a - b);
    scale += b;
  }
  EXPECT_LT(error, 0.02 * scale);
}

TEST(EmbeddingTest, DoesNotDependOnThreads) {
  const Material material = ShinyMaterial(20, 15, 16, 9);
  RunContext one;
  one.num_threads = 1;
  const auto reference = FindCodec("dsh-cls")->Embed(material, 12, one);
  ASSERT_TRUE(reference.ok());
  for (const int threads : {2, 8}) {
    RunContext many;
    many.num_threads = threads;
    const auto embedding = FindCodec("dsh-cls")->Embed(material, 12, many);
    ASSERT_TRUE(embedding.ok());
    EXPECT_EQ(embedding->values, reference->values);
    EXPECT_EQ(embedding->variance, reference->variance);
  }
}

TEST(EmbeddingTest, RefusesNonsense) {
  Material material = ShinyMaterial(2, 2, 4, 4);
  EXPECT_EQ(FindCodec("dsh-cls")->Embed(material, 0, {}).status().code(), absl::StatusCode::kInvalidArgument);
  material.width = 3;
  EXPECT_EQ(FindCodec("dsh-cls")->Embed(material, 4, {}).status().code(), absl::StatusCode::kInvalidArgument);
  material.width = 2;
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  EXPECT_EQ(FindCodec("dsh-cls")->Embed(material, 4, context).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace tessera
