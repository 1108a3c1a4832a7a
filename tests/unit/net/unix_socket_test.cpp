// The socket for programs on this machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

namespace fs = std::filesystem;
using calibration::TempFolder;
using testing::HasSubstr;
using testing::StartsWith;

v1::Status status_of(RawClient& client) {
  v1::ClientMessage message;
  message.mutable_get_status();
  return client.request(message).status();
}

class UnixSocket : public ::testing::Test {
 protected:
  UnixSocket() { config_.unix_socket = path_; }

  /// The refusal of a server with these settings.
  std::string refusal() {
    boost::asio::io_context io;
    FakePort port;
    FakeStore store;
    config_.port = 0;
    try {
      const Server server(io, config_, port, store);
      return {};
    } catch (const std::runtime_error& e) {
      return e.what();
    }
  }

  TempFolder folder_;
  fs::path path_ = folder_.path() / "dtactd.sock";
  NetConfig config_;
};

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send for constants
TEST_F(UnixSocket, ServesBesideTcpAndReportsWhoCame) {
  Rig rig(config_);
  RawClient local{connected(path_)};
  local.hello();
  RawClient remote(rig.tcp_port());
  remote.hello();
  local.subscribe(v1::DEPTH_INT16);
  rig.port.publish(make_frame(1));
  EXPECT_EQ(local.frame().sequence(), 1U);
  const auto status = status_of(remote);
  ASSERT_EQ(status.endpoints_size(), 2);
  EXPECT_EQ(status.endpoints(0).address(), path_.string());
  EXPECT_THAT(status.endpoints(1).address(), StartsWith("127.0.0.1:"));
  ASSERT_EQ(status.clients_size(), 2);
  EXPECT_EQ(status.clients(0).endpoint(), path_.string());
  EXPECT_EQ(status.clients(0).address(),
            "pid " + std::to_string(::getpid()) + " (uid " + std::to_string(::geteuid()) + ")");
}

TEST_F(UnixSocket, ServesWithoutTcp) {
  config_.address = "";
  const Rig rig(config_);
  EXPECT_EQ(rig.tcp_port(), 0);
  RawClient local{connected(path_)};
  EXPECT_NO_THROW(local.hello());
}

TEST_F(UnixSocket, NeedsNoTokenOfItsOwnUser) {
  config_.token_file = folder_.path() / "tokens";
  base::write_file_atomically(config_.token_file,
                              "view " + wire::token_hash("0123456789abcdef") + "\n", 0600);
  const Rig rig(config_);
  RawClient local{connected(path_)};
  EXPECT_EQ(local.say_hello().hello().rights(), v1::RIGHTS_CALIBRATE);
}

TEST_F(UnixSocket, AsksOtherUsersForAToken) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can become another user";
  config_.token_file = folder_.path() / "tokens";
  base::write_file_atomically(config_.token_file,
                              "view " + wire::token_hash("0123456789abcdef") + "\n", 0600);
  fs::permissions(folder_.path(), fs::perms::others_exec, fs::perm_options::add);
  const Rig rig(config_);
  // The kernel's peer is the process that connects, whichever uses the socket later. Plain system
  // calls: the C library's would signal all threads, and the child has none.
  base::UniqueFd fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const sockaddr_un address = address_of(path_);
  const pid_t child = ::fork();
  if (child == 0) {
    const bool other = ::syscall(SYS_setgroups, 0, nullptr) == 0 &&
                       ::syscall(SYS_setgid, 65534) == 0 && ::syscall(SYS_setuid, 65534) == 0;
    ::_exit(other && ::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address),
                               sizeof address) == 0
                ? 0
                : 1);
  }
  int exit = 0;
  ::waitpid(child, &exit, 0);
  ASSERT_EQ(exit, 0);
  RawClient unauthenticated{std::move(fd)};
  EXPECT_EQ(unauthenticated.say_hello().error().code(), v1::ERROR_DENIED);
}

TEST_F(UnixSocket, IsOpenToAllUsersAndGoneAfterTheEnd) {
  {
    const Rig rig(config_);
    struct stat status{};
    ASSERT_EQ(::stat(path_.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0666U);
  }
  EXPECT_FALSE(fs::exists(path_));
}

TEST_F(UnixSocket, TakesThePlaceOfOneLeftBehind) {
  {
    const base::UniqueFd left(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const sockaddr_un address = address_of(path_);
    ASSERT_EQ(::bind(left.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  ASSERT_TRUE(fs::exists(path_));
  const Rig rig(config_);
  RawClient local{connected(path_)};
  EXPECT_NO_THROW(local.hello());
}

TEST_F(UnixSocket, IsNotTakenFromAnotherDaemon) {
  const Rig rig(config_);
  EXPECT_THAT(refusal(), HasSubstr("another program listens there"));
  RawClient local{connected(path_)};
  EXPECT_NO_THROW(local.hello());
}

TEST_F(UnixSocket, NeverReplacesAFile) {
  base::write_file_atomically(path_, "precious");
  EXPECT_THAT(refusal(), HasSubstr("there is something that is no socket"));
  EXPECT_EQ(base::read_file(path_), "precious");
}

TEST_F(UnixSocket, NamesWhatIsWrongWithItsPath) {
  config_.unix_socket = folder_.path() / "no" / "folder";
  EXPECT_THAT(refusal(), HasSubstr("the socket needs a folder"));
  config_.unix_socket = folder_.path() / std::string(108, 'x');
  EXPECT_THAT(refusal(), HasSubstr("choose a shorter one"));
}

// unix(7): sun_path has 108 bytes, of which the last is 0.
TEST_F(UnixSocket, ItsPathMayHave107Bytes) {
  const std::size_t room = 107 - (folder_.path() / "").native().size();
  config_.unix_socket = folder_.path() / std::string(room + 1, 'x');
  EXPECT_THAT(refusal(), HasSubstr("108 bytes are more than a socket's path may have, 107"));
  config_.unix_socket = folder_.path() / std::string(room, 'x');
  const Rig rig(config_);
  RawClient local{connected(config_.unix_socket)};
  EXPECT_NO_THROW(local.hello());
}
// NOLINTEND(misc-const-correctness)

}  // namespace
}  // namespace dtact::net::test
