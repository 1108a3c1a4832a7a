#include "clients/cpp/address.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "clients/cpp/backoff.hpp"
#include "clients/cpp/errors.hpp"
#include "clients/cpp/options.hpp"

namespace dtact::client::test {
namespace {

using testing::HasSubstr;

struct Case {
  const char* text;
  const char* host;
  std::uint16_t port;
};

TEST(Address, HasAHostAndAPort) {
  for (const auto& [text, host, port] : {
           Case{"gripper", "gripper", 7377},
           Case{"gripper:80", "gripper", 80},
           Case{"192.0.2.7:65535", "192.0.2.7", 65535},
           Case{"::1", "::1", 7377},
           Case{"fe80::1%eth0", "fe80::1%eth0", 7377},
           Case{"[::1]", "::1", 7377},
           Case{"[::1]:80", "::1", 80},
       }) {
    const Address address = parse_address(text, 7377);
    EXPECT_EQ(address.host, host) << text;
    EXPECT_EQ(address.port, port) << text;
    EXPECT_EQ(address.unix_path, "") << text;
  }
  EXPECT_EQ(parse_address("gripper", 7377).name(), "gripper port 7377");
}

TEST(Address, IsASocketFile) {
  const Address address = parse_address("unix:/run/dtactd/dtactd.sock", 7377);
  EXPECT_EQ(address.unix_path, "/run/dtactd/dtactd.sock");
  EXPECT_EQ(address.name(), "unix:/run/dtactd/dtactd.sock");
}

TEST(Address, OtherwiseSaysWhichFormsThereAre) {
  for (const std::string& text :
       {std::string(), std::string(":80"), std::string("gripper:"), std::string("gripper:0"),
        std::string("gripper:65536"), std::string("gripper:7x"), std::string("[::1"),
        std::string("[::1]80"), std::string("unix:"), std::string("unix:run"),
        "unix:/" + std::string(107, 'x')}) {
    try {
      (void)parse_address(text, 7377);
      ADD_FAILURE() << text;
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), HasSubstr("HOST:PORT, [IPV6]:PORT or unix:/PATH"));
    }
  }
}

class Token : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "dtact_token_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path write(const std::string& text, std::filesystem::perms permissions) {
    const auto file = folder_ / "token";
    std::ofstream(file) << text;
    std::filesystem::permissions(file, permissions);
    return file;
  }
  static constexpr auto kOwner =
      std::filesystem::perms::owner_read | std::filesystem::perms::owner_write;

 private:
  std::filesystem::path folder_;
};

TEST_F(Token, IsTheFirstLine) {
  EXPECT_EQ(read_token(write("s3cret \r\nand more\n", kOwner)), "s3cret");
  EXPECT_EQ(read_token(write(std::string(256, 'x'), kOwner)), std::string(256, 'x'));
}

TEST_F(Token, IsNotReadWhereOthersMayReadItToo) {
  for (const auto others :
       {std::filesystem::perms::group_read, std::filesystem::perms::others_read}) {
    try {
      (void)read_token(write("s3cret\n", kOwner | others));
      ADD_FAILURE();
    } catch (const Error& e) {
      EXPECT_THAT(e.what(), HasSubstr("chmod 600"));
    }
  }
}

TEST_F(Token, MayBeACredentialOfRootsGroup) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a file to another group";
  const auto file = write("s3cret\n", kOwner | std::filesystem::perms::group_read);
  ASSERT_EQ(::chown(file.c_str(), 0, 0), 0);
  EXPECT_THROW((void)read_token(file), Error);
  ::setenv("CREDENTIALS_DIRECTORY", file.parent_path().c_str(), 1);
  EXPECT_EQ(read_token(file), "s3cret");
  ASSERT_EQ(::chown(file.c_str(), 0, 1), 0);
  EXPECT_THROW((void)read_token(file), Error);
  ::unsetenv("CREDENTIALS_DIRECTORY");
}

TEST_F(Token, HasToBeThere) {
  EXPECT_THROW((void)read_token(write("", kOwner)), Error);
  EXPECT_THROW((void)read_token(write("  \n", kOwner)), Error);
  EXPECT_THROW((void)read_token(write(std::string(257, 'x'), kOwner)), Error);
  EXPECT_THROW((void)read_token(write("control s3cret arm", kOwner)), Error);
  EXPECT_THROW((void)read_token("/no/such/file"), Error);
}

TEST(BackOff, DoublesUpToItsMostAndTakesARandomPartOff) {
  BackOff one({}, 1);
  BackOff two({}, 2);
  bool differ = false;
  for (const int most : {100, 200, 400, 800, 1600, 3200, 5000, 5000, 5000}) {
    const auto delay = one.next().count();
    EXPECT_GE(delay, most / 2);
    EXPECT_LE(delay, most);
    differ = differ || two.next().count() != delay;
  }
  EXPECT_TRUE(differ);
  one.reset();
  EXPECT_LE(one.next().count(), 100);
}

}  // namespace
}  // namespace dtact::client::test
