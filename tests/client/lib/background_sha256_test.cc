#include "client/lib/background_sha256.h"

#include <span>
#include <string>
#include <string_view>

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(BackgroundSha256Test, HashesPartsInTheirOrder) {
  std::string bytes;
  for (int i = 0; i < 300000; ++i) {
    bytes.push_back(static_cast<char>(i * 31 + i / 7));
  }
  for (const size_t part : {size_t{1000}, size_t{65536}, bytes.size()}) {
    BackgroundSha256 digest;
    for (size_t begin = 0; begin < bytes.size(); begin += part) {
      digest.Add(std::string_view(bytes).substr(begin, part));
    }
    EXPECT_EQ(digest.HexDigest(), Sha256Hex(std::as_bytes(std::span(bytes)))) << part;
  }
}

TEST(BackgroundSha256Test, AfterWaitTheBytesMayChange) {
  BackgroundSha256 digest;
  std::string buffer;
  std::string all;
  for (int i = 0; i < 50; ++i) {
    digest.Wait();
    buffer.assign(100000, static_cast<char>('a' + i % 26));
    digest.Add(buffer);
    all += buffer;
  }
  EXPECT_EQ(digest.HexDigest(), Sha256Hex(std::as_bytes(std::span(all))));
}

TEST(BackgroundSha256Test, NothingHasTheDigestOfNothing) {
  BackgroundSha256 digest;
  digest.Add("");
  EXPECT_EQ(digest.HexDigest(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

TEST(BackgroundSha256Test, CanBeLeftAtAnyTime) {
  const std::string bytes(1 << 20, 'x');
  for (int i = 0; i < 20; ++i) {
    BackgroundSha256 digest;
    digest.Add(bytes);
    digest.Add(bytes);
  }
}

}  // namespace
}  // namespace tessera
