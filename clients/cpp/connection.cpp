#include "clients/cpp/connection.hpp"

#include <fmt/format.h>
#include <poll.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <cerrno>

#include "clients/cpp/errors.hpp"

namespace dtact::client {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using tcp = asio::ip::tcp;

std::string remedy_for(const error_code& error, const std::string& name) {
  if (error == asio::error::connection_refused) {
    return fmt::format(
        "nothing listens on {}: is dtactd running (systemctl status dtactd), and is this its "
        "address and port?",
        name);
  }
  if (error == asio::error::timed_out) {
    return fmt::format("{} does not answer: check the address, the network and the firewall", name);
  }
  return fmt::format("cannot connect to {}: {}", name, error.message());
}

bool is_local(const tcp::socket& socket) {
  error_code error;
  const auto remote = socket.remote_endpoint(error).address();
  if (error) return false;
  return remote.is_loopback() || remote == socket.local_endpoint(error).address();
}

}  // namespace

Connection::Connection(const std::string& host, std::uint16_t port, Deadline deadline)
    : name_(fmt::format("{} port {}", host, port)), socket_(io_) {
  error_code error;
  tcp::resolver resolver(io_);
  const auto endpoints =
      resolver.resolve(host, std::to_string(port), tcp::resolver::numeric_service, error);
  if (error) {
    throw ConnectionError(
        fmt::format("cannot find the host \"{}\": {}; give its address", host, error.message()));
  }
  for (const auto& endpoint : endpoints) {
    connect(endpoint, deadline, error);
    if (!error) break;
  }
  if (error) throw ConnectionError(remedy_for(error, name_));
  socket_.set_option(tcp::no_delay(true), error);  // Only slower without.
  local_ = is_local(socket_);
}

void Connection::connect(const tcp::endpoint& endpoint, Deadline deadline, error_code& error) {
  error_code ignored;
  socket_.close(ignored);
  socket_.open(endpoint.protocol(), error);
  if (error) return;
  socket_.non_blocking(true);
  // Asio's own connect() waits without a limit, also on a non-blocking socket.
  if (::connect(socket_.native_handle(), endpoint.data(),
                static_cast<socklen_t>(endpoint.size())) == 0) {
    return;
  }
  if (errno != EINPROGRESS) {
    error = {errno, boost::system::system_category()};
    return;
  }
  if (!wait(POLLOUT, deadline)) {
    error = asio::error::timed_out;
    return;
  }
  int result = 0;
  socklen_t size = sizeof result;
  ::getsockopt(socket_.native_handle(), SOL_SOCKET, SO_ERROR, &result, &size);
  error = {result, boost::system::system_category()};
}

bool Connection::wait(short events, Deadline deadline) {
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    pollfd descriptor{socket_.native_handle(), events, 0};
    const auto limit = std::clamp<std::chrono::milliseconds::rep>(left.count(), 0, 1'000'000);
    const int ready = ::poll(&descriptor, 1, static_cast<int>(limit));
    if (ready > 0) return true;
    if (ready == 0) return false;
    if (errno != EINTR) throw ConnectionError("cannot wait for " + name_);
  }
}

void Connection::write(std::string_view message, Deadline deadline) {
  const auto length = wire::encode_length(message.size());
  std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
  bytes += message;
  send(bytes, deadline);
}

void Connection::send(std::string_view bytes, Deadline deadline) {
  while (!bytes.empty()) {
    error_code error;
    const std::size_t sent = socket_.write_some(asio::buffer(bytes.data(), bytes.size()), error);
    if (error == asio::error::would_block) {
      if (!wait(POLLOUT, deadline)) {
        throw TimeoutError(name_ + " takes no data: the daemon hangs or the network is down");
      }
    } else if (error == asio::error::broken_pipe || error == asio::error::connection_reset) {
      // The daemon ended the connection; its reason may lie unread.
      return;
    } else if (error) {
      throw ConnectionError(fmt::format("the connection to {} broke: {}", name_, error.message()));
    }
    bytes.remove_prefix(sent);
  }
}

const std::string* Connection::read(Deadline deadline) {
  for (;;) {
    switch (decoder_.feed(unread_)) {
      case wire::MessageDecoder::Result::message:
        return &decoder_.message();
      case wire::MessageDecoder::Result::too_large:
        throw ProtocolError(fmt::format(
            "{} sent a length of {} bytes: that is no dtactd, or one of another version", name_,
            decoder_.announced()));
      case wire::MessageDecoder::Result::need_more:
        break;
    }
    error_code error;
    const std::size_t size = socket_.read_some(asio::buffer(buffer_), error);
    if (error == asio::error::would_block) {
      if (!wait(POLLIN, deadline)) return nullptr;
    } else if (error == asio::error::eof || error == asio::error::connection_reset) {
      throw ConnectionError(
          fmt::format("{} ended the connection: dtactd was stopped, or it let this client go "
                      "(journalctl -u dtactd says why)",
                      name_));
    } else if (error) {
      throw ConnectionError(fmt::format("the connection to {} broke: {}", name_, error.message()));
    }
    unread_ = {buffer_.data(), size};
  }
}

}  // namespace dtact::client
