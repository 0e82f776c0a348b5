#include "btf/base/reason.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(ReasonTest, AnErrorKeepsItsReasonAndSubject) {
  const absl::Status status =
      WithReason(absl::FailedPreconditionError("no"), "NOT_ISOTROPIC", "materials/wool");
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(status.message(), "no");
  EXPECT_EQ(ReasonOf(status), "NOT_ISOTROPIC");
  EXPECT_EQ(SubjectOf(status), "materials/wool");
}

TEST(ReasonTest, AnErrorWithoutAReasonHasThatOfItsCode) {
  for (int code = 1; code <= 16; ++code) {
    EXPECT_NE(ReasonOf(absl::Status(static_cast<absl::StatusCode>(code), "x")), "") << code;
  }
  EXPECT_EQ(ReasonOf(absl::OutOfRangeError("x")), "ARGUMENT_INVALID");
  EXPECT_EQ(ReasonOf(absl::DataLossError("x")), "BLOB_CORRUPT");
  EXPECT_EQ(SubjectOf(absl::DataLossError("x")), "");
}

TEST(ReasonTest, OkHasNone) {
  EXPECT_TRUE(WithReason(absl::OkStatus(), "NAME_TAKEN", "x").ok());
  EXPECT_EQ(ReasonOf(absl::OkStatus()), "");
}

}  // namespace
}  // namespace tessera
