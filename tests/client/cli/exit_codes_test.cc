#include "client/cli/exit_codes.h"

#include <gtest/gtest.h>

#include "client/lib/client.h"

namespace tessera::cli {
namespace {

TEST(ExitCodesTest, FollowTheStatus) {
  EXPECT_EQ(ExitCodeOf(absl::OkStatus()), 0);
  EXPECT_EQ(ExitCodeOf(absl::InternalError("")), 1);
  EXPECT_EQ(ExitCodeOf(absl::ResourceExhaustedError("")), 1);
  EXPECT_EQ(ExitCodeOf(UsageError("")), 2);
  EXPECT_EQ(ExitCodeOf(absl::UnavailableError("")), 3);
  EXPECT_EQ(ExitCodeOf(absl::NotFoundError("")), 4);
  EXPECT_EQ(ExitCodeOf(absl::InvalidArgumentError("")), 5);
  EXPECT_EQ(ExitCodeOf(absl::AlreadyExistsError("")), 5);
  EXPECT_EQ(ExitCodeOf(absl::FailedPreconditionError("")), 5);
  EXPECT_EQ(ExitCodeOf(absl::DataLossError("")), 5);
  EXPECT_EQ(ExitCodeOf(absl::CancelledError("")), 130);
}

TEST(ExitCodesTest, AJobThatEndedBadlyIsSixWhateverItsError) {
  v1::Job job;
  job.set_name("jobs/3");
  job.set_state(v1::Job::FAILED);
  job.mutable_error()->set_code(static_cast<int>(absl::StatusCode::kNotFound));
  EXPECT_EQ(ExitCodeOf(JobFailure(job)), 6);
  job.set_state(v1::Job::CANCELLED);
  EXPECT_EQ(ExitCodeOf(JobFailure(job)), 6);
  job.set_state(v1::Job::SUCCEEDED);
  EXPECT_EQ(ExitCodeOf(JobFailure(job)), 0);
}

}  // namespace
}  // namespace tessera::cli
