// Encoding and decoding of "view-pca".
#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/SVD>

#include "btf/codec/codec.h"
#include "btf/codec/decoder.h"
#include "btf/codec/quantize.h"
#include "btf/codec/view_pca/overlap_error.h"
#include "btf/codec/view_pca/view_pca_decoder.h"
#include "tests/btf/codec/synthetic_btf.h"
#include "tests/support/codecs.h"
#include "tests/support/status.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

// Decoded at the sampled pair, unclamped.
Eigen::Array3d DecodeSample(const Material& material, const Decoder& decoder, size_t texel, size_t view,
                            size_t light) {
  std::vector<double> values(decoder.num_coefficients());
  decoder.Dequantize(material.btfels.btfel(texel), values);
  return decoder.Evaluate(values, VectorFromDirection(material.btfels.lights[light]),
                          VectorFromDirection(material.btfels.views[view]));
}

// What 8-bit codes and 16-bit weights may do to one decoded sample of a view.
double QuantisationBound(const Material& material, const ViewPcaDecoder& decoder, size_t view, size_t light,
                         int channel) {
  const int run = decoder.num_eigen_textures() + 1;
  const size_t first = (view * 3 + channel) * run;
  const float* const weights =
      decoder.light_weights().data() + (view * decoder.num_lights() + light) * (run - 1);
  double bound = (0.5 + kQuantizeRounding) * material.btfels.step[first];
  for (int m = 1; m < run; ++m) {
    const double largest =
        std::max(std::abs(material.btfels.offset[first + m]),
                 std::abs(material.btfels.offset[first + m] + 255.0F * material.btfels.step[first + m]));
    bound += (0.5 + kQuantizeRounding) * material.btfels.step[first + m] * std::abs(weights[m - 1]) +
             0.5 / kZeroWeight * largest;
  }
  return bound;
}

TEST(ViewPcaTest, EqualsPrincipalComponentsDoneByForce) {
  SampledBtf btf = ShinyBtf(7, 5, RingDirections(3, 5), RingDirections(4, 6));
  const size_t num_lights = btf.info().lights.size();
  constexpr int kComponents = 3;
  const auto material = Encode("view-pca", btf, {.eigen_textures = kComponents});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto decoder = ViewPcaDecoder::Create(material->btfels);
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  for (size_t view = 0; view < btf.info().views.size(); ++view) {
    Eigen::MatrixXd images(num_lights, 7 * 5 * 3);
    for (Eigen::Index i = 0; i < images.cols(); ++i) {
      for (size_t light = 0; light < num_lights; ++light) {
        images(static_cast<Eigen::Index>(light), i) = btf.at(
            static_cast<int>(i / 3 % 7), static_cast<int>(i / 21), static_cast<int>(i % 3), view, light);
      }
    }
    const Eigen::RowVectorXd mean = images.colwise().mean();
    const Eigen::MatrixXd centred = images.rowwise() - mean;
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(centred, Eigen::ComputeThinU | Eigen::ComputeThinV);
    Eigen::MatrixXd expected = svd.matrixU().leftCols(kComponents) *
                               svd.singularValues().head(kComponents).asDiagonal() *
                               svd.matrixV().leftCols(kComponents).transpose();
    expected.rowwise() += mean;
    for (Eigen::Index i = 0; i < images.cols(); ++i) {
      for (size_t light = 0; light < num_lights; ++light) {
        const int channel = static_cast<int>(i % 3);
        EXPECT_NEAR(DecodeSample(*material, **decoder, static_cast<size_t>(i / 3), view, light)[channel],
                    expected(static_cast<Eigen::Index>(light), i),
                    QuantisationBound(*material, **decoder, view, light, channel) + 2e-5);  // float sums
      }
    }
  }
}

TEST(ViewPcaTest, AllComponentsAreExactAtSampledDirections) {
  SampledBtf btf = ShinyBtf(5, 4, RingDirections(3, 6), RingDirections(3, 7));
  const auto material = Encode("view-pca", btf, {.eigen_textures = 15});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto decoder = ViewPcaDecoder::Create(material->btfels);
  ASSERT_TRUE(decoder.ok());
  EXPECT_EQ((*decoder)->num_eigen_textures(), 14);  // 15 centred samples span 14 dimensions
  double worst_bound = 0.0;
  for (size_t texel = 0; texel < 20; ++texel) {
    for (size_t view = 0; view < btf.info().views.size(); ++view) {
      for (size_t light = 0; light < btf.info().lights.size(); ++light) {
        const Eigen::Array3d rgb = DecodeSample(*material, **decoder, texel, view, light);
        for (int channel = 0; channel < 3; ++channel) {
          const double bound = QuantisationBound(*material, **decoder, view, light, channel) + 1e-5;
          worst_bound = std::max(worst_bound, bound);
          EXPECT_NEAR(rgb[channel],
                      btf.at(static_cast<int>(texel % 5), static_cast<int>(texel / 5), channel, view, light),
                      bound);
        }
      }
    }
  }
  EXPECT_LT(worst_bound, 0.02);
}

TEST(ViewPcaTest, FewerLightsThanComponents) {
  SampledBtf btf = ShinyBtf(3, 3, RingDirections(2, 4), {{0.0, 0.0}, {0.7, 1.0}});
  const auto material = Encode("view-pca", btf, {.eigen_textures = 5});
  ASSERT_TRUE(material.ok()) << material.status();
  EXPECT_EQ(material->btfels.parameters["eigen_textures"], 1);
  EXPECT_EQ(material->btfels.num_coefficients, 5 * 3 * 2);

  SampledBtf one = ShinyBtf(3, 3, {{0.2, 0.0}}, {{0.5, 1.0}});
  const auto single = Encode("view-pca", one, {.eigen_textures = 5});
  ASSERT_TRUE(single.ok()) << single.status();
  EXPECT_EQ(single->btfels.num_coefficients, 3);
  const auto decoder = MakeDecoder(single->btfels);
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  EXPECT_NEAR(DecodeSample(*single, **decoder, 4, 0, 0)[1], one.at(1, 1, 1, 0, 0),
              single->btfels.step[1] + 1e-6);
  const auto bytes = SerializeMaterial(*single);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  EXPECT_TRUE(ParseMaterial(std::as_bytes(std::span(*bytes))).ok());
}

TEST(ViewPcaTest, DegenerateBtfsStayFinite) {
  const std::vector<Direction> views = RingDirections(2, 5);
  const std::vector<Direction> lights = RingDirections(3, 4);
  for (const auto& [width, height] : {std::pair(1, 1), {1, 6}, {6, 1}, {4, 4}}) {
    for (const float value : {0.0F, 0.4F, 2e6F}) {
      SampledBtf btf(width, height, views, lights);
      for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
          for (int channel = 0; channel < 3; ++channel) {
            for (size_t v = 0; v < views.size(); ++v) {
              for (size_t l = 0; l < lights.size(); ++l) {
                btf.at(x, y, channel, v, l) = value;
              }
            }
          }
        }
      }
      const auto material = Encode("view-pca", btf, {.eigen_textures = 5});
      ASSERT_TRUE(material.ok()) << material.status();
      const auto decoder = MakeDecoder(material->btfels);
      ASSERT_TRUE(decoder.ok());
      const Eigen::Array3d rgb = (*decoder)->Decode(
          material->btfels.btfel(0), VectorFromDirection({0.6, 2.0}), VectorFromDirection({0.3, 5.0}), 1);
      for (int channel = 0; channel < 3; ++channel) {
        EXPECT_NEAR(rgb[channel], value, 1e-5 * value);
      }
      const auto embedding = FindCodec("view-pca")->Embed(*material, 4, {});
      ASSERT_TRUE(embedding.ok()) << embedding.status();
      for (const float v : embedding->values) {
        ASSERT_TRUE(std::isfinite(v));
      }
    }
  }
}

TEST(ViewPcaTest, DependsNeitherOnThreadsNorOnTheBudget) {
  SampledBtf btf = ShinyBtf(24, 20, RingDirections(3, 6), RingDirections(3, 7));
  const auto reference = Encode("view-pca", btf, {.eigen_textures = 4}, 1);
  ASSERT_TRUE(reference.ok()) << reference.status();
  const auto expected = SerializeMaterial(*reference);
  for (const int threads : {2, 8}) {
    const auto again = Encode("view-pca", btf, {.eigen_textures = 4}, threads);
    ASSERT_TRUE(again.ok());
    EXPECT_TRUE(*SerializeMaterial(*again) == *expected) << threads << " threads";
  }
  // 24 texels a row: 57 KiB of samples; coefficients are 375 KiB and spill.
  SampledBtf small = ShinyBtf(24, 20, RingDirections(3, 6), RingDirections(3, 7));
  const auto spilled = Encode("view-pca", small, {.eigen_textures = 4, .memory_budget_bytes = 300'000}, 2);
  ASSERT_TRUE(spilled.ok()) << spilled.status();
  EXPECT_TRUE(*SerializeMaterial(*spilled) == *expected);
  EXPECT_LT(small.largest_request(), 20);
}

TEST(ViewPcaTest, RefusesByName) {
  SampledBtf btf = ShinyBtf(5, 4, RingDirections(2, 5), RingDirections(3, 4));
  for (const int c : {-1, 0, 256}) {
    EXPECT_THAT(Message(Encode("view-pca", btf, {.eigen_textures = c}).status()),
                HasSubstr("eigen_textures"));
  }
  EXPECT_EQ(Encode("view-pca", btf, {.memory_budget_bytes = 1000}).status().code(),
            absl::StatusCode::kResourceExhausted);
  btf.at(3, 2, 1, 4, 7) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(Message(Encode("view-pca", btf, {}).status()),
              HasSubstr("view 4, light 7, texel (3, 2), channel 1"));
  btf.at(3, 2, 1, 4, 7) = std::numeric_limits<float>::infinity();
  EXPECT_THAT(Message(Encode("view-pca", btf, {}).status()), HasSubstr("view 4, light 7"));
  SampledBtf below(2, 2, {{0.0, 0.0}}, {{0.0, 0.0}, {1.7, 0.0}});
  EXPECT_THAT(Message(Encode("view-pca", below, {}).status()), HasSubstr("lights[1]"));
  SampledBtf none(2, 2, {}, {{0.0, 0.0}});
  EXPECT_THAT(Message(Encode("view-pca", none, {}).status()), HasSubstr("no views"));
  std::stop_source stop;
  stop.request_stop();
  RunContext context;
  context.stop = stop.get_token();
  SampledBtf good = ShinyBtf(2, 2, RingDirections(2, 5), RingDirections(3, 4));
  EXPECT_EQ(FindCodec("view-pca")->Encode(good, {}, context).status().code(), absl::StatusCode::kCancelled);
}

TEST(ViewPcaDecoderTest, InterpolatesBetweenSamplesAndReadsThreeViews) {
  SampledBtf btf = ShinyBtf(4, 4, RingDirections(4, 9), RingDirections(4, 9));
  const auto material = Encode("view-pca", btf, {.eigen_textures = 6});
  ASSERT_TRUE(material.ok()) << material.status();
  const auto decoder = ViewPcaDecoder::Create(material->btfels);
  ASSERT_TRUE(decoder.ok());
  Rng rng(4);
  for (int n = 0; n < 100; ++n) {
    const Eigen::Vector3d light =
        VectorFromDirection({1.25 * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
    const Eigen::Vector3d view = VectorFromDirection({1.25 * rng.NextDouble(), 2.0 * kPi * rng.NextDouble()});
    const LinearForm form = (*decoder)->Form(light, view);
    EXPECT_LE(form.runs.size(), 9U);
    const BarycentricWeights l = (*decoder)->lights().Locate(light);
    const BarycentricWeights v = (*decoder)->views().Locate(view);
    Eigen::Array3d expected = Eigen::Array3d::Zero();
    for (int s = 0; s < 3; ++s) {
      for (int r = 0; r < 3; ++r) {
        expected += v.weight[s] * l.weight[r] *
                    DecodeSample(*material, **decoder, 5, static_cast<size_t>(v.index[s]),
                                 static_cast<size_t>(l.index[r]));
      }
    }
    std::vector<double> values((*decoder)->num_coefficients());
    (*decoder)->Dequantize(material->btfels.btfel(5), values);
    EXPECT_LT(((*decoder)->Evaluate(values, light, view) - expected).abs().maxCoeff(), 1e-9);
  }
}

TEST(ViewPcaDecoderTest, NeverExtrapolates) {
  SampledBtf btf = ShinyBtf(4, 4, RingDirections(4, 12, 60.0), RingDirections(4, 12, 60.0));
  const auto material = Encode("view-pca", btf, {.eigen_textures = 6});
  ASSERT_TRUE(material.ok());
  const auto decoder = MakeDecoder(material->btfels);
  ASSERT_TRUE(decoder.ok());
  const auto value = [&](double light_deg, double view_deg) {
    return (*decoder)->Decode(material->btfels.btfel(6), VectorFromDirection({RadFromDeg(light_deg), 0.7}),
                              VectorFromDirection({RadFromDeg(view_deg), 4.0}), 0);
  };
  const Eigen::Array3d edge = value(60.0, 60.0);
  for (const double deg : {61.0, 75.0, 89.0}) {
    EXPECT_LT((value(60.0, deg) - edge).abs().maxCoeff(), 1e-9);
    const double scale = std::cos(RadFromDeg(deg)) / std::cos(RadFromDeg(60.0));
    EXPECT_LT((value(deg, 60.0) - scale * edge).abs().maxCoeff(), 1e-9);
  }
  EXPECT_EQ(value(90.5, 30.0).maxCoeff(), 0.0);
  EXPECT_EQ(value(30.0, 91.0).maxCoeff(), 0.0);
  // Between samples nothing leaves their range.
  Eigen::Array3d largest = Eigen::Array3d::Zero();
  for (size_t v = 0; v < btf.info().views.size(); ++v) {
    for (size_t l = 0; l < btf.info().lights.size(); ++l) {
      largest = largest.max(DecodeSample(*material, **decoder, 6, v, l));
    }
  }
  Rng rng(2);
  for (int n = 0; n < 500; ++n) {
    const Eigen::Array3d rgb = (*decoder)->Decode(
        material->btfels.btfel(6), VectorFromDirection({1.57 * rng.NextDouble(), 6.28 * rng.NextDouble()}),
        VectorFromDirection({1.57 * rng.NextDouble(), 6.28 * rng.NextDouble()}), 0);
    EXPECT_TRUE((rgb <= largest + 1e-9).all());
  }
}

TEST(ViewPcaDecoderTest, ATurnIsATurnOfBothDirections) {
  SampledBtf btf = ShinyBtf(3, 3, RingDirections(3, 7), RingDirections(3, 5));
  const auto material = Encode("view-pca", btf, {.eigen_textures = 3});
  ASSERT_TRUE(material.ok());
  const auto decoder = MakeDecoder(material->btfels);
  ASSERT_TRUE(decoder.ok());
  const Eigen::Vector3d light = VectorFromDirection({0.8, 1.1});
  const Eigen::Vector3d view = VectorFromDirection({0.4, 3.3});
  for (int turns = 0; turns < 4; ++turns) {
    const Eigen::Array3d turned = (*decoder)->Decode(material->btfels.btfel(4), light, view, turns);
    const Eigen::Array3d expected =
        (*decoder)->Decode(material->btfels.btfel(4), VectorFromDirection({0.8, 1.1 - turns * kPi / 2.0}),
                           VectorFromDirection({0.4, 3.3 - turns * kPi / 2.0}), 0);
    EXPECT_LT((turned - expected).abs().maxCoeff(), 1e-9);
  }
}

TEST(ViewPcaDecoderTest, RoundTripsThroughTheContainer) {
  SampledBtf btf = ShinyBtf(4, 3, RingDirections(4, 12), RingDirections(4, 12));
  const auto material = Encode("view-pca", btf, {.eigen_textures = 4});
  ASSERT_TRUE(material.ok());
  const auto bytes = SerializeMaterial(*material);
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  const auto read = ParseMaterial(std::as_bytes(std::span(*bytes)));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->btfels.tables.at("light_weights").dtype, DType::kU16);
  EXPECT_EQ(read->btfels.tables.at("view_triangles").dtype, DType::kU16);
  EXPECT_TRUE(*SerializeMaterial(*read) == *bytes);
  const auto before = MakeDecoder(material->btfels);
  const auto after = MakeDecoder(read->btfels);
  ASSERT_TRUE(before.ok() && after.ok());
  Rng rng(3);
  for (int n = 0; n < 200; ++n) {
    const Eigen::Vector3d light = VectorFromDirection({1.5 * rng.NextDouble(), 6.28 * rng.NextDouble()});
    const Eigen::Vector3d view = VectorFromDirection({1.5 * rng.NextDouble(), 6.28 * rng.NextDouble()});
    // Directions are stored as float32.
    EXPECT_LT(((*before)->Decode(material->btfels.btfel(5), light, view, 0) -
               (*after)->Decode(read->btfels.btfel(5), light, view, 0))
                  .abs()
                  .maxCoeff(),
              1e-5);
  }
}

TEST(ViewPcaDecoderTest, RefusesTablesThatDoNotFit) {
  SampledBtf btf = ShinyBtf(2, 2, RingDirections(3, 6), RingDirections(3, 6));
  const Material material = *Encode("view-pca", btf, {.eigen_textures = 4});
  struct Case {
    const char* message;
    std::function<void(BtfelTable&)> change;
  };
  const Case cases[] = {
      {"'light_weights' is missing", [](BtfelTable& t) { t.tables.erase("light_weights"); }},
      {"'light_triangles' is missing", [](BtfelTable& t) { t.tables.erase("light_triangles"); }},
      {"'view_triangles' is missing", [](BtfelTable& t) { t.tables.erase("view_triangles"); }},
      {", 12, 4], expected", [](BtfelTable& t) { t.tables["light_weights"].shape[1] = 12; }},
      {"'light_weights': 65535", [](BtfelTable& t) { t.tables["light_weights"].values[3] = 65535.0F; }},
      {"'view_triangles': corner 13", [](BtfelTable& t) { t.tables["view_triangles"].values[5] = 13.0F; }},
      {"'view_triangles': corner 0.5", [](BtfelTable& t) { t.tables["view_triangles"].values[5] = 0.5F; }},
      {"of shape [3, 4], expected [-1, 3]",
       [](BtfelTable& t) {
         t.tables["light_triangles"].shape = {3, 4};
       }},
      {"of shape [0, 3], expected [-1, 3]",
       [](BtfelTable& t) {
         t.tables["light_triangles"].shape = {0, 3};
         t.tables["light_triangles"].values.clear();
       }},
      {"'light_triangles': 27 triangles",
       [](BtfelTable& t) {
         t.tables["light_triangles"].shape = {27, 3};
         t.tables["light_triangles"].values.assign(81, 0.0F);
       }},
      {"eigen_textures", [](BtfelTable& t) { t.parameters.erase("eigen_textures"); }},
      {"eigen_textures", [](BtfelTable& t) { t.parameters["eigen_textures"] = -1; }},
      {"eigen_textures", [](BtfelTable& t) { t.parameters["eigen_textures"] = "4"; }},
      {"coefficients", [](BtfelTable& t) { t.parameters["eigen_textures"] = 5; }},
      {"coefficients", [](BtfelTable& t) { t.step.pop_back(); }},
      {"coefficients", [](BtfelTable& t) { t.views.pop_back(); }},
      {"lights", [](BtfelTable& t) { t.lights.clear(); }},
      {"lights", [](BtfelTable& t) { t.lights[2].theta_rad = 2.0; }},
      {"lights: there are 5000", [](BtfelTable& t) { t.lights.resize(5000); }},
  };
  for (const Case& c : cases) {
    BtfelTable table = material.btfels;
    c.change(table);
    const absl::Status status = MakeDecoder(table).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << c.message;
    EXPECT_THAT(Message(status), HasSubstr(c.message));
  }
}

TEST(OverlapErrorTest, ChanceIsASensitivityOfOne) {
  SampledBtf btf = ShinyBtf(12, 12, RingDirections(3, 8), RingDirections(3, 8));
  const auto material = Encode("view-pca", btf, {.eigen_textures = 5});
  ASSERT_TRUE(material.ok());
  const auto embedding = FindCodec("view-pca")->Embed(*material, 8, {});
  ASSERT_TRUE(embedding.ok());
  std::vector<OverlapPixel> same;
  std::vector<OverlapPixel> random;
  Rng rng(7);
  const auto texel = [&] {
    return TurnedTexel{static_cast<int>(rng.NextBelow(12)), static_cast<int>(rng.NextBelow(12)),
                       static_cast<int>(rng.NextBelow(4))};
  };
  for (int n = 0; n < 20000; ++n) {
    same.push_back({texel(), {}});
    same.back().second = same.back().first;
    random.push_back({texel(), texel()});
  }
  for (const int c : {1, 5, 8, 100}) {
    EXPECT_EQ(OverlapError(*embedding, c, same), 0.0);
    const double threshold = OverlapErrorThreshold(*embedding, c, 1.0);
    // 20,000 draws: the mean of the squared distances is off by a few of its 1%.
    EXPECT_NEAR(OverlapError(*embedding, c, random), threshold, 0.05 * threshold);
    EXPECT_NEAR(OverlapErrorThreshold(*embedding, c, 0.5), 0.25 * threshold, 1e-12);
  }
  EXPECT_EQ(OverlapError(*embedding, 5, {}), 0.0);
  EXPECT_EQ(OverlapErrorThreshold(*embedding, 0, 1.0), 0.0);
}

}  // namespace
}  // namespace tessera
