#include "clients/cpp/client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <utility>

#include "clients/cpp/connection.hpp"
#include "clients/cpp/convert.hpp"
#include "proto/dtact.pb.h"

namespace dtact::client {
namespace {

/// Frames kept while a request waits for its answer; the oldest give way.
constexpr std::size_t kKeptFrames = 4;
/// Calibrations are parsed, and some written to a disk, before the request is answered.
constexpr std::chrono::seconds kParseTimeout{30};

}  // namespace

struct Client::Impl {
  explicit Impl(const Options& o)
      : options(o), connection(o.host, o.port, std::chrono::steady_clock::now() + o.timeout) {}

  [[nodiscard]] std::optional<v1::ServerMessage> receive(Connection::Deadline deadline);
  [[nodiscard]] v1::Reply request(v1::ClientMessage& message, std::chrono::milliseconds timeout);
  [[nodiscard]] std::chrono::milliseconds parse_timeout() const {
    return std::max<std::chrono::milliseconds>(options.timeout, kParseTimeout);
  }
  void keep(v1::ServerMessage message);

  Options options;
  Connection connection;
  ServerInfo server;
  std::uint64_t next_id = 1;
  std::deque<v1::ServerMessage> inbox;
};

std::optional<v1::ServerMessage> Client::Impl::receive(Connection::Deadline deadline) {
  const std::string* bytes = connection.read(deadline);
  if (bytes == nullptr) return std::nullopt;
  v1::ServerMessage message;
  if (!message.ParseFromString(*bytes)) {
    throw ProtocolError("the answer was no dtact message: is there another program on this port?");
  }
  return message;
}

void Client::Impl::keep(v1::ServerMessage message) {
  if (message.has_frame()) {
    const auto is_frame = [](const v1::ServerMessage& m) { return m.has_frame(); };
    if (static_cast<std::size_t>(std::count_if(inbox.begin(), inbox.end(), is_frame)) >=
        kKeptFrames) {
      inbox.erase(std::find_if(inbox.begin(), inbox.end(), is_frame));
    }
  }
  inbox.push_back(std::move(message));
}

v1::Reply Client::Impl::request(v1::ClientMessage& message, std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  const std::uint64_t id = next_id++;
  message.set_id(id);
  if (message.ByteSizeLong() > wire::kMaxMessage) {
    throw Refused(Code::too_large, fmt::format("the request has {} bytes, at most {} can be sent",
                                               message.ByteSizeLong(), wire::kMaxMessage));
  }
  connection.write(message.SerializeAsString(), deadline);
  for (;;) {
    auto received = receive(deadline);
    if (!received.has_value()) {
      throw TimeoutError("the daemon gave no answer in time: look at journalctl -u dtactd");
    }
    if (!received->has_reply()) {
      keep(*std::move(received));
      if (std::chrono::steady_clock::now() < deadline) continue;
      throw TimeoutError("the daemon streams, but gave no answer in time");
    }
    auto& reply = *received->mutable_reply();
    // Id 0: the daemon says why it ends the connection.
    if (reply.id() != id && reply.id() != 0) continue;
    if (!reply.has_error()) return std::move(reply);
    const auto code = static_cast<Code>(reply.error().code());
    if (code == Code::version) throw ProtocolError(reply.error().message());
    if (reply.id() == 0) throw ConnectionError(reply.error().message());
    throw Refused(code, reply.error().message());
  }
}

Client::Client(const Options& options) : impl_(std::make_unique<Impl>(options)) {
  v1::ClientMessage message;
  auto& hello = *message.mutable_hello();
  hello.set_major(wire::kMajor);
  hello.set_minor(wire::kMinor);
  hello.set_program(options.program.substr(0, wire::kMaxProgramName));
  const auto reply = impl_->request(message, options.timeout);
  impl_->server = {reply.hello().program(), reply.hello().major(), reply.hello().minor(),
                   reply.hello().surface_frame().frame_id()};
}

Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

const ServerInfo& Client::server() const noexcept { return impl_->server; }
bool Client::same_machine() const noexcept { return impl_->connection.local(); }

void Client::subscribe(const Subscription& subscription) {
  v1::ClientMessage message;
  auto& request = *message.mutable_subscribe();
  request.set_depth(static_cast<v1::DepthEncoding>(subscription.depth));
  request.set_luma(static_cast<v1::LumaEncoding>(subscription.luma));
  request.set_every(subscription.every);
  request.set_summary(subscription.summary);
  (void)impl_->request(message, impl_->options.timeout);
}

Light Client::set_light(const LightChange& change) {
  v1::ClientMessage message;
  auto& request = *message.mutable_set_light();
  if (change.brightness.has_value()) {
    // A negative one becomes far too large, and the daemon says what is allowed.
    request.set_brightness(static_cast<std::uint32_t>(*change.brightness));
  }
  if (change.scheme.has_value()) request.set_scheme(*change.scheme);
  for (const auto& led : change.leds) {
    auto& to = *request.add_leds();
    to.set_r(led.r);
    to.set_g(led.g);
    to.set_b(led.b);
  }
  return to_light(impl_->request(message, impl_->options.timeout).light());
}

void Client::rezero(bool force) {
  v1::ClientMessage message;
  message.mutable_rezero()->set_force(force);
  (void)impl_->request(message, impl_->options.timeout);
}

Status Client::status() {
  v1::ClientMessage message;
  message.mutable_get_status();
  return to_status(impl_->request(message, impl_->options.timeout).status());
}

CalibrationFiles Client::calibration(std::optional<std::uint64_t> number) {
  v1::ClientMessage message;
  auto& request = *message.mutable_get_calibration();
  if (number.has_value()) request.set_number(*number);
  const auto reply = impl_->request(message, impl_->options.timeout);
  const auto& files = reply.calibration();
  CalibrationFiles read{files.name(), files.calibration_toml(), files.reference_png()};
  if (files.has_number()) read.number = files.number();
  if (number.has_value() && read.number != number) {
    throw Refused(Code::invalid,
                  "this daemon is older and knows only its current calibration: update dtactd");
  }
  return read;
}

std::vector<StoredCalibration> Client::calibrations() {
  v1::ClientMessage message;
  message.mutable_list_calibrations();
  const auto reply = impl_->request(message, impl_->parse_timeout());
  std::vector<StoredCalibration> calibrations;
  for (const auto& stored : reply.calibrations().calibrations()) {
    calibrations.push_back(to_stored(stored));
  }
  return calibrations;
}

std::optional<std::uint64_t> Client::upload_calibration(const CalibrationFiles& files) {
  v1::ClientMessage message;
  auto& request = *message.mutable_upload_calibration();
  request.set_name(files.name);
  request.set_calibration_toml(files.toml);
  request.set_reference_png(files.png);
  const auto reply = impl_->request(message, impl_->parse_timeout());
  if (!reply.done().has_calibration()) return std::nullopt;
  return reply.done().calibration();
}

void Client::activate_calibration(std::uint64_t number) {
  v1::ClientMessage message;
  message.mutable_activate_calibration()->set_number(number);
  (void)impl_->request(message, impl_->parse_timeout());
}

std::optional<std::variant<Frame, Event>> Client::next(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  for (;;) {
    std::optional<v1::ServerMessage> message;
    if (!impl_->inbox.empty()) {
      message = std::move(impl_->inbox.front());
      impl_->inbox.pop_front();
    } else {
      message = impl_->receive(deadline);
      if (!message.has_value()) return std::nullopt;
    }
    if (message->has_frame()) return to_frame(message->frame());
    if (message->has_event()) {
      if (auto event = to_event(message->event())) return *std::move(event);
    }
    if (message->has_reply() && message->reply().id() == 0 && message->reply().has_error()) {
      throw ConnectionError(message->reply().error().message());
    }
  }
}

}  // namespace dtact::client
