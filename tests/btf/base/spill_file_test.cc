// Temporary files without a name.
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/base/spill_file.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

TEST(SpillFileTest, KeepsWhatIsWrittenEitherWay) {
  const TempFolder folder;
  absl::StatusOr<SpillFile> created = SpillFile::Create(folder.path(), 10000);
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  SpillFile file = *std::move(created);
  const std::string text = "behind the first page";
  ASSERT_TRUE(file.Write(5000, std::as_bytes(std::span(text))).ok());
  const auto mapped = file.Map();
  ASSERT_TRUE(mapped.ok()) << mapped.status();
  ASSERT_EQ(mapped->size(), 10000u);
  EXPECT_EQ((*mapped)[4999], std::byte{0});
  EXPECT_EQ((*mapped)[5000], std::byte{'b'});
  (*mapped)[5000] = std::byte{'B'};
  file.DropPages();
  EXPECT_EQ((*mapped)[5000], std::byte{'B'});
  std::string read(text.size(), '\0');
  ASSERT_TRUE(file.Read(5000, std::as_writable_bytes(std::span(read))).ok());
  EXPECT_EQ(read, "Behind the first page");
  EXPECT_EQ(file.Read(9999, std::as_writable_bytes(std::span(read))).code(), absl::StatusCode::kDataLoss);
}

TEST(SpillFileTest, RefusesWhatTheDiskHasNoRoomFor) {
  const absl::Status status = SpillFile::Create({}, uint64_t{1} << 60).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_THAT(std::string(status.message()), HasSubstr("1152921504606846976 bytes are needed"));
  EXPECT_FALSE(SpillFile::Create("/nowhere", 1).ok());
}

}  // namespace
}  // namespace tessera
