#include "btf/base/atomic_file.h"

#include <cerrno>

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "btf/base/file_error.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

int FilesIn(const fs::path& folder) {
  return static_cast<int>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(AtomicFileTest, HasItsNameOnlyAfterCommit) {
  const TempFolder folder;
  const fs::path path = folder.path() / "out.bin";
  ASSERT_TRUE(WriteFileAtomically(path, "old").ok());
  {
    auto file = AtomicFile::Create(path);
    ASSERT_TRUE(file.ok()) << file.status();
    ASSERT_TRUE(file->Write("new").ok());
    EXPECT_EQ(ReadWholeFile(path).value(), "old");
    ASSERT_TRUE(file->Commit().ok());
  }
  EXPECT_EQ(ReadWholeFile(path).value(), "new");
  EXPECT_EQ(FilesIn(folder.path()), 1);
}

TEST(AtomicFileTest, LeavesNothingWithoutCommit) {
  const TempFolder folder;
  {
    auto file = AtomicFile::Create(folder.path() / "out.bin");
    ASSERT_TRUE(file.ok()) << file.status();
    ASSERT_TRUE(file->Write("half").ok());
  }
  EXPECT_EQ(FilesIn(folder.path()), 0);
}

TEST(AtomicFileTest, NamesThePathAndTheReason) {
  const TempFolder folder;
  const absl::Status missing = WriteFileAtomically(folder.path() / "no" / "out.bin", "x");
  EXPECT_TRUE(absl::IsNotFound(missing)) << missing;
  EXPECT_NE(missing.message().find("out.bin"), absl::string_view::npos);
  EXPECT_TRUE(absl::IsInvalidArgument(WriteFileAtomically(folder.path(), "x")));
  EXPECT_TRUE(absl::IsNotFound(ReadWholeFile(folder.path() / "none").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(ReadWholeFile(folder.path()).status()));
}

// The command line's exit code for UNAVAILABLE says that there is no server.
TEST(FileErrorTest, NeverLooksLikeAMissingServer) {
  for (const int error : {EIO, EBUSY, EAGAIN, ENOSPC, EMFILE, ENOENT, EACCES, EISDIR, 12345}) {
    EXPECT_FALSE(absl::IsUnavailable(FileError(error, "cannot read", "a.png"))) << error;
  }
  EXPECT_EQ(FileError(EACCES, "cannot open", "a.png").message(), "a.png: cannot open: Permission denied");
}

TEST(AtomicFileTest, GivesTheModeOfTheUmask) {
  const TempFolder folder;
  const fs::path path = folder.path() / "out.bin";
  const mode_t old_mask = umask(027);
  EXPECT_TRUE(WriteFileAtomically(path, "x").ok());
  EXPECT_EQ(fs::status(path).permissions(), fs::perms{0640});
  umask(077);
  EXPECT_TRUE(WriteFileAtomically(path, "y").ok());
  EXPECT_EQ(fs::status(path).permissions(), fs::perms{0600});
  EXPECT_EQ(umask(old_mask), mode_t{077});
}

}  // namespace
}  // namespace tessera
