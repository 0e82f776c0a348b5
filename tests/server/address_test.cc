#include "server/address.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(AddressTest, AddressesComeBack) {
  for (const char* text : {"127.0.0.1:7723", "localhost:0", "[::1]:65535"}) {
    const auto address = ParseListenAddress(text);
    ASSERT_TRUE(address.ok()) << address.status();
    EXPECT_EQ(ListenAddressText(*address), text);
    EXPECT_TRUE(IsLoopback(address->host)) << text;
  }
}

TEST(AddressTest, WrongOnesAreRefused) {
  for (const char* text :
       {"", "localhost", ":1", "localhost:", "localhost:x", "localhost:65536", "::1:80", "a:-1"}) {
    EXPECT_EQ(ParseListenAddress(text).status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
}

TEST(AddressTest, OnlyLoopbackIsLoopback) {
  EXPECT_TRUE(IsLoopback("127.9.8.7"));
  for (const char* host :
       {"0.0.0.0", "192.168.0.1", "::", "example.org", "127.0.0.1.example.org", "localhost2"}) {
    EXPECT_FALSE(IsLoopback(host)) << host;
  }
}

}  // namespace
}  // namespace tessera
