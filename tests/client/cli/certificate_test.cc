#include "client/cli/certificate.h"

#include <gtest/gtest.h>

namespace tessera::cli {
namespace {

TEST(CertificateTest, WarnsOfEveryPartAboveTheStatedLimit) {
  const Json certificate = {{"limit", 2.0}, {"borders", {{"ratio", 1.9}}}, {"insides", {{"ratio", 2.1}}}};
  const std::vector<std::string> warnings = CertificateWarnings(certificate);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("insides"), std::string::npos);
  EXPECT_NE(warnings[0].find("2.10"), std::string::npos);
}

TEST(CertificateTest, SaysNothingWithoutALimit) {
  EXPECT_TRUE(CertificateWarnings(Json::object()).empty());
  EXPECT_TRUE(CertificateWarnings(Json{{"borders", {{"ratio", 9.0}}}}).empty());
  EXPECT_TRUE(CertificateWarnings(Json{{"limit", "2"}, {"borders", {{"ratio", 9.0}}}}).empty());
}

}  // namespace
}  // namespace tessera::cli
