#include "client/cli/pattern.h"

#include <gtest/gtest.h>

namespace tessera::cli {
namespace {

TEST(PatternTextTest, TellsWhatWasMeasured) {
  EXPECT_EQ(PatternText({{"anisotropy", 1.52}, {"anisotropy_limit", 1.35}, {"feature_size", 10.04}}),
            "anisotropy 1.52 (isotropic 1, limit of turned strips 1.35), features of 10.0 texels");
  EXPECT_EQ(PatternText({{"feature_size", 10.0}, {"period", {{7.11, 7.1}, {-7.1, 7.1}}}}),
            "features of 10.0 texels, repeats every (7.1, 7.1) and (-7.1, 7.1) texels");
}

TEST(PatternTextTest, LeavesOutWhatIsMissing) {
  EXPECT_EQ(PatternText(Json::object()), "");
  EXPECT_EQ(PatternText(Json("none")), "");
  EXPECT_EQ(PatternText({{"anisotropy", "high"}, {"period", {{1.0}}}}), "");
}

}  // namespace
}  // namespace tessera::cli
