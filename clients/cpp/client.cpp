#include "clients/cpp/client.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <utility>

#include "clients/cpp/connection.hpp"
#include "proto/framing.hpp"

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
  v1::HelloReply server;
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
    throw Refused(v1::ERROR_TOO_LARGE,
                  fmt::format("the request has {} bytes, at most {} can be sent",
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
    const v1::ErrorCode code = reply.error().code();
    if (code == v1::ERROR_VERSION) throw ProtocolError(reply.error().message());
    if (reply.id() == 0) throw ConnectionError(reply.error().message());
    throw Refused(code, reply.error().message());
  }
}

v1::Subscribe depth_stream() {
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_INT16);
  return subscription;
}

Client::Client(const Options& options) : impl_(std::make_unique<Impl>(options)) {
  v1::ClientMessage message;
  auto& hello = *message.mutable_hello();
  hello.set_major(wire::kMajor);
  hello.set_minor(wire::kMinor);
  hello.set_program(options.program.substr(0, wire::kMaxProgramName));
  impl_->server = impl_->request(message, options.timeout).hello();
}

Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

const v1::HelloReply& Client::server() const noexcept { return impl_->server; }
bool Client::same_machine() const noexcept { return impl_->connection.local(); }

void Client::subscribe(const v1::Subscribe& subscription) {
  v1::ClientMessage message;
  *message.mutable_subscribe() = subscription;
  (void)impl_->request(message, impl_->options.timeout);
}

v1::LightState Client::set_light(const v1::SetLight& change) {
  v1::ClientMessage message;
  *message.mutable_set_light() = change;
  return impl_->request(message, impl_->options.timeout).light();
}

void Client::rezero(bool force) {
  v1::ClientMessage message;
  message.mutable_rezero()->set_force(force);
  (void)impl_->request(message, impl_->options.timeout);
}

v1::Status Client::status() {
  v1::ClientMessage message;
  message.mutable_get_status();
  return impl_->request(message, impl_->options.timeout).status();
}

v1::CalibrationFiles Client::calibration(std::optional<std::uint64_t> number) {
  v1::ClientMessage message;
  auto& request = *message.mutable_get_calibration();
  if (number.has_value()) request.set_number(*number);
  v1::Reply reply = impl_->request(message, impl_->options.timeout);
  v1::CalibrationFiles& files = *reply.mutable_calibration();
  if (number.has_value() && (!files.has_number() || files.number() != *number)) {
    throw Refused(v1::ERROR_INVALID,
                  "this daemon is older and knows only its current calibration: update dtactd");
  }
  return std::move(files);
}

std::vector<v1::StoredCalibration> Client::calibrations() {
  v1::ClientMessage message;
  message.mutable_list_calibrations();
  v1::Reply reply = impl_->request(message, impl_->parse_timeout());
  auto& calibrations = *reply.mutable_calibrations()->mutable_calibrations();
  for (v1::StoredCalibration& stored : calibrations) {
    if (!stored.has_in_use()) stored.set_in_use(stored.current());
  }
  return {calibrations.begin(), calibrations.end()};
}

std::optional<std::uint64_t> Client::upload_calibration(const v1::UploadCalibration& files) {
  v1::ClientMessage message;
  *message.mutable_upload_calibration() = files;
  const auto reply = impl_->request(message, impl_->parse_timeout());
  if (!reply.done().has_calibration()) return std::nullopt;
  return reply.done().calibration();
}

void Client::activate_calibration(std::uint64_t number) {
  v1::ClientMessage message;
  message.mutable_activate_calibration()->set_number(number);
  (void)impl_->request(message, impl_->parse_timeout());
}

std::optional<std::variant<v1::Frame, v1::Event>> Client::next(std::chrono::milliseconds timeout) {
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
    if (message->has_frame()) return std::move(*message->mutable_frame());
    // Not a kind of event that this library does not know.
    if (message->has_event() && message->event().what_case() != v1::Event::WHAT_NOT_SET) {
      return std::move(*message->mutable_event());
    }
    if (message->has_reply() && message->reply().id() == 0 && message->reply().has_error()) {
      throw ConnectionError(message->reply().error().message());
    }
  }
}

}  // namespace dtact::client
