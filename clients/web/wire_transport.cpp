#include "clients/web/wire_transport.hpp"

#include <boost/asio/error.hpp>
#include <utility>

namespace dtact::web {

namespace asio = boost::asio;
using boost::system::error_code;

WireTransport::WireTransport(std::shared_ptr<WebSocket> socket, net::Peer peer,
                             std::shared_ptr<void> place)
    : Transport(std::move(peer)), socket_(std::move(socket)), place_(std::move(place)) {}

void WireTransport::send_text(std::string text) {
  texts_.push_back(std::move(text));
  if (texts_.size() > 2) texts_.pop_front();
  if (!writing_) write_text();
}

void WireTransport::write_text() {
  writing_ = true;
  const auto text = std::make_shared<const std::string>(std::move(texts_.front()));
  texts_.pop_front();
  // No one else waits for this write, so it owns what it needs.
  socket_->write(
      {asio::buffer(*text)}, true,
      [weak = std::weak_ptr(self_), socket = socket_, text](const error_code&, std::size_t) {
        const auto self = weak.lock();
        if (self == nullptr) return;
        WireTransport& transport = **self;
        transport.writing_ = false;
        // What an error means the next write or read finds out.
        if (auto next = std::exchange(transport.next_, nullptr)) return next();
        if (!transport.texts_.empty()) transport.write_text();
      });
}

void WireTransport::read_some(asio::mutable_buffer into, Done done) {
  socket_->read_some(into, [done = std::move(done)](error_code error, WebSocket::Received got) {
    if (!error && got.text) error = asio::error::operation_not_supported;
    done(error, got.bytes);
  });
}

void WireTransport::write(const Parts& parts, Done done) {
  if (writing_) {
    next_ = [this, parts, done = std::move(done)]() mutable { write(parts, std::move(done)); };
    return;
  }
  writing_ = true;
  socket_->write(parts, false,
                 [this, done = std::move(done)](const error_code& error, std::size_t size) {
                   writing_ = false;
                   if (!texts_.empty() && !error) write_text();
                   done(error, size);
                 });
}

void WireTransport::shutdown_send(std::shared_ptr<void> held) {
  if (writing_) {
    next_ = [this, held = std::move(held)] { socket_->end(held); };
    return;
  }
  socket_->end(std::move(held));
}

}  // namespace dtact::web
