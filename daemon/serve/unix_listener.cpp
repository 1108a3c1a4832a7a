#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <boost/asio/local/stream_protocol.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

#include "daemon/serve/accept_loop.hpp"
#include "daemon/serve/listener.hpp"
#include "hal/base/unique_fd.hpp"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
namespace fs = std::filesystem;
using Unix = asio::local::stream_protocol;

[[noreturn]] void refuse_path(const fs::path& path, const std::string& why) {
  throw std::runtime_error(fmt::format("cannot listen on {}: {}", path.string(), why));
}

sockaddr_un address_of(const fs::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string& text = path.native();
  if (text.size() >= sizeof address.sun_path) {
    refuse_path(path,
                fmt::format("{} bytes are more than a socket's path may have, {}: choose a shorter "
                            "one",
                            text.size(), sizeof address.sun_path - 1));
  }
  text.copy(static_cast<char*>(address.sun_path), text.size());
  return address;
}

base::UniqueFd make_socket() {
  return base::UniqueFd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
}

/// Removes a socket left behind by a daemon that was killed. Keeps a socket with a listener and
/// files that are no socket.
void remove_stale(const fs::path& path, const sockaddr_un& address) {
  struct stat status{};
  if (::lstat(path.c_str(), &status) != 0) return;
  if (!S_ISSOCK(status.st_mode)) {
    refuse_path(path, "there is something that is no socket: remove it or choose another path");
  }
  const base::UniqueFd probe = make_socket();
  if (::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ||
      errno != ECONNREFUSED) {
    refuse_path(path,
                "another program listens there, perhaps another dtactd (systemctl status dtactd): "
                "stop it or choose another path");
  }
  ::unlink(path.c_str());
}

/// The socket's file, removed at the end unless another one has taken its place.
class SocketFile {
 public:
  explicit SocketFile(const fs::path& path) : path_(path) {
    const sockaddr_un address = address_of(path);
    remove_stale(path, address);
    fd_ = make_socket();
    if (::bind(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      const int error = errno;
      refuse_path(path, fmt::format("{}; the socket needs a folder that this user may write",
                                    std::strerror(error)));
    }
    // Everybody may connect; who the peer is decides what it may do.
    if (::chmod(path.c_str(), 0666) != 0 || ::listen(fd_.get(), SOMAXCONN) != 0 ||
        ::stat(path.c_str(), &status_) != 0) {
      const int error = errno;
      ::unlink(path.c_str());
      refuse_path(path, std::strerror(error));
    }
  }
  ~SocketFile() {
    struct stat now{};
    if (::stat(path_.c_str(), &now) == 0 && now.st_dev == status_.st_dev &&
        now.st_ino == status_.st_ino) {
      ::unlink(path_.c_str());
    }
  }
  SocketFile(const SocketFile&) = delete;
  SocketFile& operator=(const SocketFile&) = delete;

  [[nodiscard]] int release() { return fd_.release(); }

 private:
  fs::path path_;
  base::UniqueFd fd_;
  struct stat status_{};
};

class UnixListener : public Listener {
 public:
  UnixListener(asio::io_context& io, const NetConfig& config, OnConnection on_connection)
      : address_(config.unix_socket.string()),
        file_(config.unix_socket),
        loop_(std::make_shared<AcceptLoop<Unix>>(
            Unix::acceptor(io, Unix(), file_.release()), config.log,
            [this, on_connection = std::move(on_connection)](Unix::socket socket) {
              on_connection(over_unix(std::move(socket), address_));
            })) {}

  void start() override { loop_->accept(); }
  void stop() override { loop_->stop(); }
  [[nodiscard]] const std::string& address() const override { return address_; }
  [[nodiscard]] std::uint16_t port() const override { return 0; }

 private:
  std::string address_;
  SocketFile file_;
  std::shared_ptr<AcceptLoop<Unix>> loop_;
};

}  // namespace

std::shared_ptr<Listener> listen_unix(asio::io_context& io, const NetConfig& config,
                                      OnConnection on_connection) {
  return std::make_shared<UnixListener>(io, config, std::move(on_connection));
}

}  // namespace dtact::net
