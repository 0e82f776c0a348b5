#include "client/cli/certificate.h"

#include <gtest/gtest.h>

namespace tessera::cli {
namespace {

TEST(CertificateTest, WarnsOfEveryPartAboveTheLimit) {
  const Json certificate = {
      {"images", {1, 2}}, {"borders", {{"ratio", 1.5}}}, {"insides", {{"ratio", 1.51}}}};
  const std::vector<std::string> warnings = CertificateWarnings(certificate);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("insides read 1.51, above the limit of 1.50"), std::string::npos) << warnings[0];
}

TEST(CertificateTest, PutsSeamsBesideTheControls) {
  const Json certificate = {{"images", {{"count", 256}, {"of", 6561}}},
                            {"borders", {{"ratio", 1.25}, {"cut_share", 0.5}}},
                            {"controls", {{"random_minimum_cuts", 2.5}}},
                            {"repetition", {{"ratio", 0.75}, {"plane_peak", 0.3}, {"exemplar_peak", 0.4}}}};
  const std::string text = CertificateText(certificate);
  for (const char* const part :
       {"1.250", "50.0", "2.500", "in 256 of 6561 images", "0.75 times the material's"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << " is not in\n" << text;
  }
  EXPECT_FALSE(CertificateText(Json::object()).empty());
}

TEST(CertificateTest, TellsWhetherARegularMaterialKeepsItsPeriod) {
  const auto with = [](double kept) {
    return Json{{"repetition", {{"period", {{"kept", kept}, {"plane", 0.4}, {"exemplar", 0.8}}}}}};
  };
  EXPECT_NE(CertificateText(with(0.5)).find("period kept 0.50 times as well"), std::string::npos);
  EXPECT_TRUE(CertificateWarnings(with(0.95)).empty());
  const std::vector<std::string> warnings = CertificateWarnings(with(0.5));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("keeps 0.50 of it, below the limit of 0.80"), std::string::npos) << warnings[0];
}

TEST(CertificateTest, WarnsOfAPlaneThatRepeats) {
  const auto with = [](double ratio) { return Json{{"repetition", {{"ratio", ratio}}}}; };
  EXPECT_TRUE(CertificateWarnings(with(1.2)).empty());
  const std::vector<std::string> warnings = CertificateWarnings(with(1.21));
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("repeats 1.21 times as much as the material, above the limit of 1.20"),
            std::string::npos)
      << warnings[0];
}

TEST(CertificateTest, SaysNothingOfACertificateWithoutFigures) {
  EXPECT_TRUE(CertificateWarnings(Json::object()).empty());
  EXPECT_TRUE(CertificateWarnings(Json("none")).empty());
  EXPECT_TRUE(CertificateWarnings(Json{{"borders", {{"ratio", "9"}}}}).empty());
}

}  // namespace
}  // namespace tessera::cli
