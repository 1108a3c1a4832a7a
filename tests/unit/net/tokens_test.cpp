#include "daemon/serve/tokens.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "daemon/serve/private_file.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::net::test {
namespace {

using calibration::TempFolder;
using testing::HasSubstr;
using testing::Not;

/// The refusal of the text; empty when it is accepted.
std::string refusal(const std::string& text) {
  try {
    const Tokens tokens(text, "/etc/tokens");
    return {};
  } catch (const std::runtime_error& e) {
    return e.what();
  }
}

// What sha256sum prints of 0123456789abcdef and of fedcba9876543210.
constexpr const char* kHash =
    "sha256:9f9f5111f7b27a781f1f1ddde5ebc2dd2b796bfc7365c9c28b548e564176929f";
constexpr const char* kOtherHash =
    "sha256:3465f6e6975baa864ca957f0914ecda9bf7eb601ac31ac20a5dc3d329279a843";

TEST(Tokens, GrantWhatTheirLineSays) {
  const Tokens tokens(std::string("# for the gripper\n\n  control ") + kHash +
                          " arm_left\r\nview\t" + kOtherHash + "\ncalibrate " +
                          wire::token_hash("89abcdef01234567") + " bench",
                      "f");
  EXPECT_EQ(tokens.find("0123456789abcdef")->rights, Rights::control);
  EXPECT_EQ(tokens.find("0123456789abcdef")->name, "arm_left");
  EXPECT_EQ(tokens.find("fedcba9876543210")->rights, Rights::view);
  EXPECT_EQ(tokens.find("fedcba9876543210")->name, "");
  EXPECT_EQ(tokens.find("89abcdef01234567")->rights, Rights::calibrate);
}

TEST(Tokens, KnowNoOthers) {
  const Tokens tokens(std::string("view ") + kHash + "\n", "f");
  // A reader of the file has the hash, and cannot enter with it.
  for (const char* other :
       {"", "0123456789abcde", "0123456789abcdef0", "0123456789abcdeF", kHash, kHash + 7}) {
    EXPECT_FALSE(tokens.find(other).has_value()) << other;
  }
}

TEST(Tokens, NameFileLineAndFix) {
  const std::string hash = kHash;
  EXPECT_THAT(refusal("# a\nmay " + hash + "\n"), HasSubstr("/etc/tokens:2: a line is \"view"));
  EXPECT_THAT(refusal("view\n"), HasSubstr("/etc/tokens:1: a line is"));
  EXPECT_THAT(refusal("view " + hash + " a b\n"), HasSubstr("/etc/tokens:1: a line is"));
  EXPECT_THAT(
      refusal("#\ncontrol 0123456789abcdef0123456789abcdef arm\n"),
      HasSubstr("/etc/tokens:2: a token itself must not be kept here, only its hash: with the "
                "token in FILE, dtactctl token --hash control --token-file FILE prints"));
  std::string upper = hash;
  upper.back() = 'A';
  for (const std::string& wrong : {hash.substr(0, 70), hash + "0", upper, std::string("sha256:")}) {
    EXPECT_THAT(refusal("view " + wrong), HasSubstr("followed by 64 hexadecimal digits")) << wrong;
  }
  EXPECT_THAT(refusal("view " + hash + "\xc3\xa4\n"), HasSubstr("only printable ASCII"));
  EXPECT_THAT(refusal("view " + hash + "\ncontrol " + hash + "\n"),
              HasSubstr("/etc/tokens:2: the same token stands on a line above"));
  EXPECT_THAT(refusal(""), HasSubstr("holds no token"));
  EXPECT_THAT(refusal("#\n"), HasSubstr("dtactctl token --new control -o FILE prints one"));
}

TEST(Tokens, AreNotReportedInErrors) {
  EXPECT_THAT(refusal("contrlo 0123456789abcdef\n"), Not(HasSubstr("0123456789abcdef")));
  EXPECT_THAT(refusal("view 0123456789abcdef\n"), Not(HasSubstr("0123456789abcdef")));
}

std::string unreadable(const std::filesystem::path& path) {
  try {
    (void)read_private_file(path, "the token file");
    return {};
  } catch (const std::runtime_error& e) {
    return e.what();
  }
}

TEST(PrivateFile, IsReadWhenItIsPrivate) {
  const TempFolder folder;
  const auto path = folder.path() / "tokens";
  base::write_file_atomically(path, "secret", 0600);
  EXPECT_EQ(read_private_file(path, "the token file"), "secret");
  base::write_file_atomically(path, "secret", 0400);
  EXPECT_EQ(read_private_file(path, "the token file"), "secret");
}

TEST(PrivateFile, IsRefusedWhenOthersMayReadIt) {
  const TempFolder folder;
  const auto path = folder.path() / "tokens";
  base::write_file_atomically(path, "secret", 0604);
  EXPECT_EQ(unreadable(path), "the token file " + path.string() +
                                  ": is open to others (mode 604): chmod 600 " + path.string());
  base::write_file_atomically(path, "secret", 0602);
  EXPECT_THAT(unreadable(path), HasSubstr("chmod 600"));
}

TEST(PrivateFile, OfAGroupIsRefusedUnlessItIsRoots) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file to another group";
  const TempFolder folder;
  const auto path = folder.path() / "tokens";
  base::write_file_atomically(path, "secret", 0640);
  EXPECT_EQ(unreadable(path), "");
  ASSERT_EQ(::chown(path.c_str(), 0, 1), 0);
  EXPECT_THAT(unreadable(path), HasSubstr("is open to others (mode 640)"));
}

TEST(PrivateFile, NeitherWaitsForAPipeNorReadsDevices) {
  const TempFolder folder;
  const auto pipe = folder.path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THAT(unreadable(pipe), HasSubstr("is not a regular file"));
  EXPECT_THAT(unreadable("/dev/zero"), HasSubstr("is not a regular file"));
  EXPECT_THAT(unreadable(folder.path()), HasSubstr("is not a regular file"));
  EXPECT_THAT(unreadable(folder.path() / "none"), HasSubstr("check the path"));
}

TEST(PrivateFile, IsBounded) {
  const TempFolder folder;
  const auto path = folder.path() / "tokens";
  base::write_file_atomically(path, std::string(64 * 1024 + 1, '#'), 0600);
  EXPECT_THAT(unreadable(path), HasSubstr("is larger than 65536 bytes"));
  base::write_file_atomically(path, std::string(64 * 1024, '#'), 0600);
  EXPECT_EQ(read_private_file(path, "the token file").size(), 65536U);
}

}  // namespace
}  // namespace dtact::net::test
