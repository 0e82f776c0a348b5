#include "btf/chart/jpeg_peer.h"

#include <cmath>

#include <gtest/gtest.h>

#include "btf/data/direction_sets.h"
#include "btf/image/transfer.h"
#include "tests/support/noise_btf.h"
#include "tests/support/read_btf.h"

namespace tessera {
namespace {

class JpegPeerTest : public ::testing::Test {
 protected:
  NoiseBtf source_{24, 20, *DirectionSet("2x5"), *DirectionSet("1x6")};
};

TEST_F(JpegPeerTest, HighQualityIsNearTheSamples) {
  const auto peer = JpegPeer::Create(source_, 4, {});
  ASSERT_TRUE(peer.ok()) << peer.status();
  const auto set = peer->Encode(100, {});
  ASSERT_TRUE(set.ok()) << set.status();
  const auto picture = peer->Picture(100, Split::kSampled, 7, 2);
  ASSERT_TRUE(picture.ok());
  const std::vector<float> samples = AllSamples(source_);
  double squares = 0.0;
  double references = 0.0;
  std::vector<float> row(24 * 3);
  for (int y = 0; y < 20; ++y) {
    if (y % 4 == 0) {
      peer->Row(*set, Split::kSampled, y, 7, 2, row);
    }
    for (int i = 0; i < 24 * 3; ++i) {
      const double truth = std::clamp(samples[((y * 24 * 3 + i) * 10 + 7) * 6 + 2], 0.0F, 1.0F);
      squares += std::pow(picture->at(0, y)[i] - truth, 2);
      references += truth * truth;
      if (y % 4 == 0) {
        EXPECT_NEAR(row[i], picture->at(0, y)[i], 1e-6);
      }
    }
  }
  // Noise of its own in every channel does not survive 4:2:0; light and dark do.
  EXPECT_LT(std::sqrt(squares / references), 0.3);
}

TEST_F(JpegPeerTest, BytesGrowWithQualityAndBisectionMeetsThem) {
  const auto peer = JpegPeer::Create(source_, 4, {});
  ASSERT_TRUE(peer.ok());
  const auto small = peer->Encode(20, {});
  const auto large = peer->Encode(80, {});
  ASSERT_TRUE(small.ok() && large.ok());
  EXPECT_LT(small->size_bytes, large->size_bytes);
  EXPECT_GT(small->decode_s, 0.0);
  const auto quality = peer->QualityFor(large->size_bytes, {});
  ASSERT_TRUE(quality.ok());
  EXPECT_GE(*quality, 80);
  EXPECT_LE(peer->Encode(*quality, {})->size_bytes, large->size_bytes);
  EXPECT_GT(peer->Encode(*quality + 1, {})->size_bytes, large->size_bytes);
  EXPECT_EQ(*peer->QualityFor(10, {}), 1);
}

TEST_F(JpegPeerTest, HeldOutDirectionsShowTheNearestKeptImage) {
  const auto peer = JpegPeer::Create(source_, 4, {});
  ASSERT_TRUE(peer.ok());
  // Lights at azimuths 0, 60, .. 300 degrees: 4 is held out; 3 and 5 are as near, the first is taken.
  EXPECT_EQ(peer->ShownImage(Split::kSampled, 1, 4), 1U * 6 + 4);
  EXPECT_EQ(peer->ShownImage(Split::kHeldOutViews, 1, 4), 1U * 6 + 4);
  const size_t shown = peer->ShownImage(Split::kHeldOutLights, 1, 4);
  EXPECT_TRUE(shown == 1U * 6 + 3 || shown == 1U * 6 + 5) << shown;
  EXPECT_EQ(peer->ShownImage(Split::kHeldOutLights, 1, 3), 1U * 6 + 3);
}

}  // namespace
}  // namespace tessera
