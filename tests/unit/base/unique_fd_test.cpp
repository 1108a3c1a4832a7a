#include "hal/base/unique_fd.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <cerrno>

namespace dtact::base {
namespace {

bool is_open(int fd) { return ::fcntl(fd, F_GETFD) != -1; }
UniqueFd open_null() { return UniqueFd(::open("/dev/null", O_RDONLY | O_CLOEXEC)); }

TEST(UniqueFd, EmptyOwnsNothing) {
  const UniqueFd fd;
  EXPECT_FALSE(fd);
  EXPECT_EQ(fd.get(), -1);
}

TEST(UniqueFd, ClosesWhenItDies) {
  int raw = -1;
  {
    const UniqueFd fd = open_null();
    raw = fd.get();
    EXPECT_TRUE(is_open(raw));
  }
  EXPECT_FALSE(is_open(raw));
}

TEST(UniqueFd, MoveAssignmentClosesTheOldOne) {
  UniqueFd a = open_null();
  UniqueFd b = open_null();
  const int old = a.get();
  const int kept = b.get();
  a = std::move(b);
  EXPECT_FALSE(is_open(old));
  EXPECT_EQ(a.get(), kept);
  EXPECT_FALSE(b);  // NOLINT(bugprone-use-after-move): empty by contract
}

TEST(UniqueFd, ReleaseHandsOver) {
  UniqueFd fd = open_null();
  const int raw = fd.release();
  EXPECT_FALSE(fd);
  EXPECT_TRUE(is_open(raw));
  ::close(raw);
}

TEST(UniqueFd, ClosingKeepsErrno) {
  UniqueFd fd = open_null();
  errno = EPERM;
  fd.reset();
  EXPECT_EQ(errno, EPERM);
}

}  // namespace
}  // namespace dtact::base
