#include "hal/base/atomic_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <system_error>

#include "tests/fakes/file_log.hpp"
#include "tests/fakes/own_path.hpp"

namespace dtact::base {
namespace {

namespace fs = std::filesystem;

class AtomicFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fakes::own_path();
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] int files() const {
    return static_cast<int>(std::distance(fs::directory_iterator(folder_), {}));
  }
  fs::path folder_;
};

TEST_F(AtomicFile, WritesAndReplaces) {
  const fs::path file = folder_ / "a";
  write_file_atomically(file, "one");
  EXPECT_EQ(read_file(file), "one");
  write_file_atomically(file, "");
  EXPECT_EQ(read_file(file), "");
  EXPECT_EQ(files(), 1);
}

// A power cut after the rename loses data that is not yet on the disk. The rename itself is lost
// until its folder is on the disk.
TEST_F(AtomicFile, IsOnTheDiskBeforeItTakesThePlaceOfTheOldOne) {
  const fakes::FileLog log(folder_);
  write_file_atomically(folder_ / "a", "one");
  EXPECT_THAT(log.calls(), testing::ElementsAre("write a.XXXXXX", "sync a.XXXXXX",
                                                "rename a.XXXXXX to a", "sync ."));
}

TEST_F(AtomicFile, FailureLeavesTheOldFileAndNoOther) {
  const fs::path file = folder_ / "dir";
  fs::create_directories(file / "inside");  // a file cannot replace a folder with content
  EXPECT_THROW(write_file_atomically(file, "x"), std::system_error);
  EXPECT_TRUE(fs::exists(file / "inside"));
  EXPECT_EQ(files(), 1);
}

/// Files of this process may have this many bytes while it lives.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit few{bytes, before_.rlim_max};
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    ::setrlimit(RLIMIT_FSIZE, &few);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    (void)std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int) = nullptr;
};

// The kernel takes the first bytes and refuses the rest, as on a full disk.
TEST_F(AtomicFile, WhatCannotBeWrittenWholeLeavesTheOldFileAndNoOther) {
  const fs::path file = folder_ / "a";
  write_file_atomically(file, "mine");
  {
    const FileSizeLimit limit(10);
    EXPECT_THROW(write_file_atomically(file, std::string(11, 'x')), std::system_error);
    EXPECT_EQ(read_file(file), "mine");
    EXPECT_EQ(files(), 1);
    write_file_atomically(file, std::string(10, 'y'));
  }
  EXPECT_EQ(read_file(file), std::string(10, 'y'));
  EXPECT_EQ(files(), 1);
}

TEST_F(AtomicFile, IsReadableToAllUnlessItIsPrivate) {
  const auto mode_of = [](const fs::path& file) { return fs::status(file).permissions(); };
  write_file_atomically(folder_ / "a", "x");
  EXPECT_EQ(mode_of(folder_ / "a"), fs::perms(0644));
  write_file_atomically(folder_ / "a", "x", 0600);
  EXPECT_EQ(mode_of(folder_ / "a"), fs::perms(0600));
}

TEST_F(AtomicFile, ReadNamesTheMissingFile) {
  try {
    (void)read_file(folder_ / "none");
    FAIL();
  } catch (const std::system_error& e) {
    EXPECT_NE(std::string(e.what()).find("none"), std::string::npos);
  }
}

TEST_F(AtomicFile, TextIsReadWithoutItsByteOrderMark) {
  write_file_atomically(folder_ / "a",
                        "\xEF\xBB\xBF"
                        "frames,force\n");
  EXPECT_EQ(read_text_file(folder_ / "a"), "frames,force\n");
  EXPECT_EQ(read_file(folder_ / "a").size(), 16U);
  write_file_atomically(folder_ / "a", "b\xEF\xBB\xBF");
  EXPECT_EQ(read_text_file(folder_ / "a"), "b\xEF\xBB\xBF");
}

TEST_F(AtomicFile, ReadRefusesMoreThanTheLimit) {
  write_file_atomically(folder_ / "a", "12345");
  EXPECT_EQ(read_file(folder_ / "a", 5), "12345");
  EXPECT_THROW((void)read_file(folder_ / "a", 4), std::system_error);
}

}  // namespace
}  // namespace dtact::base
