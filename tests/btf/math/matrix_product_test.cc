#include <gtest/gtest.h>
#include <Eigen/Core>

namespace tessera {
namespace {

// Blocks of other sizes round in another way: a material would have other bytes on a machine with other
// caches.
TEST(MatrixProductTest, IsSummedInBlocksThatDoNotDependOnTheMachine) {
  EXPECT_EQ(Eigen::l1CacheSize(), 48 * 1024);
  EXPECT_EQ(Eigen::l2CacheSize(), 512 * 1024);
  EXPECT_EQ(Eigen::l3CacheSize(), 32 * 1024 * 1024);
}

}  // namespace
}  // namespace tessera
