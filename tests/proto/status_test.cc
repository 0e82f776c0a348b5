#include "proto/wire/status.h"

#include <gtest/gtest.h>

#include "tessera/v1/tessera.pb.h"

namespace tessera {
namespace {

TEST(WireStatusTest, OkStaysOk) {
  EXPECT_TRUE(GrpcFromStatus(absl::OkStatus()).ok());
  EXPECT_TRUE(StatusFromGrpc(grpc::Status::OK).ok());
  EXPECT_EQ(ReasonOf(absl::OkStatus()), "");
}

TEST(WireStatusTest, EveryCodeMessageReasonAndSubjectComeBack) {
  for (int code = 1; code <= 16; ++code) {
    const absl::Status sent =
        WithReason(absl::Status(static_cast<absl::StatusCode>(code), "materials/wool exists"), "NAME_TAKEN",
                   "materials/wool");
    const absl::Status received = StatusFromGrpc(GrpcFromStatus(sent));
    EXPECT_EQ(received, sent) << code;
    EXPECT_EQ(ReasonOf(received), "NAME_TAKEN");
    EXPECT_EQ(SubjectOf(received), "materials/wool");
  }
}

TEST(WireStatusTest, AnErrorWithoutAReasonGetsThatOfItsCode) {
  EXPECT_EQ(ReasonOf(StatusFromGrpc(GrpcFromStatus(absl::InvalidArgumentError("kl 3")))), "ARGUMENT_INVALID");
  EXPECT_EQ(ReasonOf(StatusFromGrpc(GrpcFromStatus(absl::InternalError("x")))), "INTERNAL");
}

TEST(WireStatusTest, TheTrailerHasTheBytesOfGoogleRpcStatus) {
  v1::RpcStatus parsed;
  ASSERT_TRUE(parsed.ParseFromString(GrpcFromStatus(absl::NotFoundError("no")).error_details()));
  EXPECT_EQ(parsed.code(), 5);
  EXPECT_EQ(parsed.message(), "no");
  ASSERT_EQ(parsed.details_size(), 1);
  EXPECT_EQ(parsed.details(0).type_url(), "type.googleapis.com/tessera.v1.ErrorDetail");
}

TEST(WireStatusTest, DetailsOfOthersAreIgnored) {
  const absl::Status status =
      StatusFromGrpc(grpc::Status(grpc::StatusCode::UNAVAILABLE, "down", "not a message"));
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ReasonOf(status), "UNAVAILABLE");
}

}  // namespace
}  // namespace tessera
