#include "clients/web/guided/relay.hpp"

#include <boost/asio/buffer.hpp>
#include <chrono>
#include <exception>
#include <string_view>
#include <utility>

#include "clients/common/guided.pb.h"
#include "clients/common/json.hpp"

namespace dtact::web::guided {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

/// How dtact-calibrate begins a line that holds a scene.
constexpr std::string_view kScene = R"({"scene":)";
/// How long a page may take to read the reason before it is closed.
constexpr std::chrono::seconds kLinger{10};
/// Sentences that wait for a page that does not read: a session says a few a minute.
constexpr std::size_t kMaxTexts = 256;

}  // namespace

Relay::Relay(std::shared_ptr<WebSocket> socket, Handlers handlers)
    : socket_(std::move(socket)), handlers_(std::move(handlers)), linger_(socket_->executor()) {}

void Relay::start() { read(); }

void Relay::refuse(const std::string& sentence) {
  finish(sentence);
  read();
}

void Relay::read() {
  socket_->read_some(asio::buffer(piece_),
                     [self = shared_from_this()](const error_code& error, WebSocket::Received got) {
                       if (error) return self->over();
                       self->received_.append(self->piece_.data(), got.bytes);
                       if (got.end) self->take(std::exchange(self->received_, {}));
                       if (!self->over_) self->read();
                     });
}

void Relay::take(const std::string& message) {
  if (finished_) return;
  if (child_ != nullptr) {
    if (message.find('\n') != std::string::npos) return finish("an answer is one line");
    if (!child_->type(message)) finish("more was answered than was asked");
    return;
  }
  const std::weak_ptr<Relay> weak = weak_from_this();
  try {
    Child::Handlers handlers;
    handlers.line = [weak](std::string line) {
      if (const auto self = weak.lock()) self->send_text(std::move(line));
    };
    handlers.ended = [weak](int status, const std::string& errors) {
      if (const auto self = weak.lock()) self->on_child_ended(status, errors);
    };
    child_ = handlers_.begin(message, *this, std::move(handlers));
  } catch (const std::exception& e) {
    finish(e.what());
  }
}

void Relay::send_text(std::string text) {
  if (finished_) return;
  if (texts_.size() >= kMaxTexts) return finish("this page has not read for too long");
  queue(std::move(text));
}

void Relay::queue(std::string text) {
  if (text.starts_with(kScene)) {
    scene_ = std::move(text);
  } else {
    // What is said belongs to the scene before it.
    if (!scene_.empty()) texts_.push_back(std::exchange(scene_, {}));
    texts_.push_back(std::move(text));
  }
  if (!writing_) write_next();
}

void Relay::write_next() {
  if (texts_.empty() && scene_.empty()) {
    if (finished_) socket_->end(shared_from_this());
    return;
  }
  writing_ = true;
  if (texts_.empty()) texts_.push_back(std::exchange(scene_, {}));
  const auto text = std::make_shared<const std::string>(std::move(texts_.front()));
  texts_.pop_front();
  socket_->write({asio::buffer(*text)}, true,
                 [self = shared_from_this(), text](const error_code& error, std::size_t) {
                   self->writing_ = false;
                   // The next read finds out what an error means.
                   if (!error) self->write_next();
                 });
}

void Relay::on_child_ended(int status, const std::string& errors) {
  if (status == 0) return finish("");
  finish(errors.empty() ? "dtact-calibrate ended by itself" : errors);
}

void Relay::finish(const std::string& error) {
  if (finished_) return;
  cli::GuidedLine line;
  line.mutable_ended()->set_error(error);
  finished_ = true;
  queue(cli::json_line(line));
  linger_.expires_after(kLinger);
  linger_.async_wait([weak = weak_from_this()](const error_code& ended) {
    const auto self = weak.lock();
    if (!ended && self != nullptr) self->over();
  });
  if (child_ != nullptr) child_->end();
}

void Relay::over() {
  if (std::exchange(over_, true)) return;
  finished_ = true;
  linger_.cancel();
  if (child_ != nullptr) child_->end();
  socket_->close();
  handlers_.ended();
}

}  // namespace dtact::web::guided
