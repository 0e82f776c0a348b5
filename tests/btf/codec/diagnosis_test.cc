// Each weakness that is warned of, and silence where there is none.
#include "btf/codec/diagnosis.h"

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "tests/btf/codec/synthetic_btf.h"

namespace tessera {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Diagnosis DiagnosisOf(SampledBtf& btf, const EncodeParams& params) {
  const auto material = FindCodec("dsh-cls")->Encode(btf, params, {});
  EXPECT_TRUE(material.ok()) << material.status();
  const auto diagnosis = DiagnoseMaterial(btf, *material, {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return *diagnosis;
}

const EncodeParams kFew = {.kl = 9, .kv = 9, .cls_energy = ClsEnergy::kSphere};

TEST(DiagnosisTest, IsSilentOnASoundMaterial) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(5, 12), RingDirections(5, 12));
  const Diagnosis d = DiagnosisOf(btf, kFew);
  EXPECT_THAT(d.warnings, IsEmpty());
  EXPECT_GT(d.rms, 0.0);
  EXPECT_GT(d.rmse, 0.0);
  EXPECT_LT(d.rmse, kErrorLimit * d.rms);
  EXPECT_NEAR(DegFromRad(d.largest_light_theta_rad), 75.0, 1e-9);
}

TEST(DiagnosisTest, NamesTheDamagedImage) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(5, 12), RingDirections(5, 12));
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 6; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        btf.at(x, y, channel, 7, 4) = 9.0F;
      }
    }
  }
  const Diagnosis d = DiagnosisOf(btf, kFew);
  EXPECT_EQ(d.worst_view, 7U);
  EXPECT_EQ(d.worst_light, 4U);
  EXPECT_THAT(d.warnings, Contains(HasSubstr("view 7, light 4")));
}

TEST(DiagnosisTest, WarnsOfDirections) {
  // 13 lights up to 50 degrees; views without any below 60 degrees.
  std::vector<Direction> views = RingDirections(6, 16);
  std::erase_if(views, [](const Direction& d) { return d.theta_rad < RadFromDeg(59.0); });
  SampledBtf btf = ShinyBtf(4, 4, views, RingDirections(2, 12, 50.0));
  const Diagnosis d = DiagnosisOf(btf, {.kl = 16, .kv = 9, .cls_energy = ClsEnergy::kSphere});
  EXPECT_NEAR(DegFromRad(d.view_gap_rad), 60.0, 1e-6);
  EXPECT_THAT(d.warnings, Contains(HasSubstr("kl = 16 coefficients from 13 lights")));
  EXPECT_THAT(d.warnings, Contains(HasSubstr("60 degrees from every measured view")));
  EXPECT_THAT(d.warnings, Contains(HasSubstr("lights are measured up to 50 degrees")));
}

TEST(DiagnosisTest, WarnsOfClippedHighlights) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(5, 12), RingDirections(5, 12));
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 6; ++x) {
      for (int channel = 0; channel < 3; ++channel) {
        for (size_t view = 0; view < btf.info().views.size(); ++view) {
          for (size_t light = 0; light < btf.info().lights.size(); ++light) {
            float& value = btf.at(x, y, channel, view, light);
            value = std::min(value, 0.4F);
          }
        }
      }
    }
  }
  const Diagnosis d = DiagnosisOf(btf, kFew);
  EXPECT_GT(d.saturated_share, kSaturatedShareLimit);
  EXPECT_THAT(d.warnings, Contains(HasSubstr("clipped")));
}

TEST(DiagnosisTest, MeasuresTheNoiseOfRounding) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(5, 12), RingDirections(5, 12));
  auto material = FindCodec("dsh-cls")->Encode(btf, kFew, {});
  ASSERT_TRUE(material.ok());
  const auto before = DiagnoseMaterial(btf, *material, {});
  for (float& step : material->btfels.step) {
    step *= 1000.0F;
  }
  const auto after = DiagnoseMaterial(btf, *material, {});
  ASSERT_TRUE(before.ok() && after.ok());
  EXPECT_NEAR(after->quantisation_noise / before->quantisation_noise, 1000.0, 1.0);
  EXPECT_THAT(after->warnings, Contains(HasSubstr("8 bits")));
  EXPECT_THAT(after->warnings, Contains(HasSubstr("of the signal, limit 0.25")));
}

TEST(DiagnosisTest, IsRecordedInTheMetadata) {
  SampledBtf btf = ShinyBtf(4, 4, RingDirections(5, 12), RingDirections(2, 12, 50.0));
  auto material = FindCodec("dsh-cls")->Encode(btf, kFew, {});
  ASSERT_TRUE(material.ok());
  ASSERT_TRUE(RecordDiagnosis(btf, {}, *material).ok());
  const auto d = DiagnoseMaterial(btf, *material, {});
  const nlohmann::json& recorded = material->metadata.at("diagnosis");
  EXPECT_EQ(recorded.at("rmse"), d->rmse);
  EXPECT_NEAR(recorded.at("largest_light_theta_deg").get<double>(), 50.0, 1e-9);
  EXPECT_EQ(recorded.at("warnings").size(), d->warnings.size());
  EXPECT_GE(d->warnings.size(), 1U);
}

TEST(DiagnosisTest, RefusesAnotherSource) {
  SampledBtf btf = ShinyBtf(6, 6, RingDirections(3, 6), RingDirections(3, 6));
  SampledBtf other = ShinyBtf(6, 5, RingDirections(3, 6), RingDirections(3, 6));
  const auto material = FindCodec("dsh-cls")->Encode(btf, kFew, {});
  ASSERT_TRUE(material.ok());
  EXPECT_EQ(DiagnoseMaterial(other, *material, {}).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace tessera
