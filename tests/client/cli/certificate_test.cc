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

TEST(CertificateTest, SaysNothingOfACertificateWithoutFigures) {
  EXPECT_TRUE(CertificateWarnings(Json::object()).empty());
  EXPECT_TRUE(CertificateWarnings(Json("none")).empty());
  EXPECT_TRUE(CertificateWarnings(Json{{"borders", {{"ratio", "9"}}}}).empty());
}

}  // namespace
}  // namespace tessera::cli
