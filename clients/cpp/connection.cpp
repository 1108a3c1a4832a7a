#include "clients/cpp/connection.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <system_error>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/tls.hpp"

namespace dtact::client {
namespace {

[[noreturn]] void broke(const std::string& name, int error) {
  throw ConnectionError(
      fmt::format("the connection to {} broke: {}", name, std::generic_category().message(error)));
}

}  // namespace

Connection::Connection(const Options& options, const Limit& limit)
    : Connection(options, parse_address(options.host, options.port), limit) {}

Connection::Connection(const Options& options, const Address& address, const Limit& limit)
    : name_(address.name()),
      socket_(connect_to(address, limit)),
      encrypted_(options.tls.has_value() && address.unix_path.empty()) {
  if (encrypted_) {
    channel_ =
        std::make_unique<TlsChannel>(socket_.fd.get(), *options.tls, address.host, name_, limit);
  } else {
    channel_ = std::make_unique<PlainChannel>(socket_.fd.get());
  }
}

void Connection::write(std::string_view message, const Limit& limit) {
  const auto length = wire::encode_length(message.size());
  std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
  bytes += message;
  send(bytes, limit);
}

void Connection::send(std::string_view bytes, const Limit& limit) {
  while (!bytes.empty()) {
    const Transfer sent = channel_->write(bytes);
    if (sent.wait != 0) {
      if (!wait(socket_.fd.get(), sent.wait, limit)) {
        throw ConnectionError(name_ + " takes no data: the daemon hangs or the network is down");
      }
    } else if (sent.error == EPIPE || sent.error == ECONNRESET ||
               (sent.error == 0 && sent.bytes == 0)) {
      // The daemon ended the connection; its reason may lie unread.
      return;
    } else if (sent.error != 0) {
      broke(name_, sent.error);
    }
    bytes.remove_prefix(sent.bytes);
  }
}

const std::string* Connection::read(const Limit& limit) {
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
    const Transfer got = channel_->read(buffer_);
    if (got.wait != 0) {
      if (!wait(socket_.fd.get(), got.wait, limit)) return nullptr;
    } else if (got.bytes == 0 && (got.error == 0 || got.error == ECONNRESET)) {
      throw ConnectionError(
          fmt::format("{} ended the connection: dtactd was stopped, or it let this client go "
                      "(journalctl -u dtactd says why){}",
                      name_,
                      heard_ || encrypted_ ? ""
                                           : ", or it speaks TLS there: then give its fingerprint "
                                             "(dtactctl cert --show prints it on its machine)"));
    } else if (got.error == ETIMEDOUT) {
      throw ConnectionError(name_ + " is gone without a word: its machine or the network is down");
    } else if (got.error != 0) {
      broke(name_, got.error);
    }
    heard_ = heard_ || got.bytes > 0;
    unread_ = {buffer_.data(), got.bytes};
  }
}

}  // namespace dtact::client
