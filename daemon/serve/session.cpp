#include "daemon/serve/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <utility>

#include "daemon/serve/change_log.hpp"
#include "daemon/serve/large_message.hpp"
#include "hal/base/utf8.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

/// How long an ending connection may take to fetch its last answer.
constexpr std::chrono::milliseconds kLinger{2000};
/// How long a large message may take to arrive: the longest at 1.1 Mbit/s.
constexpr std::chrono::milliseconds kArrival{120'000};
/// Bytes of a message that count neither as large nor as a second request.
constexpr std::size_t kSmall = std::size_t{64} * 1024;
/// Bytes read at once, before Hello and after it.
constexpr std::size_t kInputBeforeHello = 1024;
constexpr std::size_t kInput = 16384;

/// The least rights that allow it. A request unknown to this daemon does no harm.
Rights rights_for(v1::ClientMessage::RequestCase request) {
  switch (request) {
    case v1::ClientMessage::kSetLight:
    case v1::ClientMessage::kSetCamera:
    case v1::ClientMessage::kRezero:
    case v1::ClientMessage::kSetReconstruction:
      return Rights::control;
    case v1::ClientMessage::kUploadCalibration:
    case v1::ClientMessage::kActivateCalibration:
    case v1::ClientMessage::kPinCalibration:
      return Rights::calibrate;
    case v1::ClientMessage::kHello:
    case v1::ClientMessage::kSubscribe:
    case v1::ClientMessage::kGetStatus:
    case v1::ClientMessage::kGetCalibration:
    case v1::ClientMessage::kListCalibrations:
    case v1::ClientMessage::kGetReference:
    case v1::ClientMessage::kPing:
    case v1::ClientMessage::REQUEST_NOT_SET:
      return Rights::view;
  }
  return Rights::view;
}

const char* denial(Rights needed) {
  return needed == Rights::calibrate
             ? "this client may not change calibrations: connect with a token that allows calibrate"
             : "this client may view only: connect with a token that allows control";
}

}  // namespace

Session::Session(std::unique_ptr<Transport> transport, const NetConfig& config,
                 Admission& admission, std::weak_ptr<SessionHost> host)
    : transport_(std::move(transport)),
      outbox_(*transport_, *this),
      timer_(transport_->executor()),
      config_(config),
      admission_(admission),
      host_(std::move(host)),
      requests_(config.max_requests_per_s, config.max_requests_per_s) {}

void Session::start() {
  arm_timer(config_.hello_timeout, "no Hello came");
  transport_->handshake([self = shared_from_this()](const error_code& error) {
    if (self->state_ == State::closed) return;
    if (!error) return self->read();
    self->close(fmt::format("no TLS: {}", error.message()), LogLevel::warning);
  });
}

void Session::arm_timer(std::chrono::milliseconds after, const char* reason) {
  timer_.expires_after(after);
  timer_.async_wait([self = shared_from_this(), reason](const error_code& error) {
    if (!error) self->close(reason);
  });
}

void Session::read() {
  input_.resize(grant_ ? kInput : kInputBeforeHello);
  transport_->read_some(asio::buffer(input_),
                        [self = shared_from_this()](const error_code& error, std::size_t size) {
                          if (self->state_ == State::closed) return;
                          if (error == asio::error::eof) return self->close("the client left");
                          if (error) return self->close(error.message());
                          self->take({self->input_.data(), size});
                          if (self->state_ != State::closed) self->read();
                        });
}

void Session::take(std::string_view input) {
  while (state_ == State::fresh || state_ == State::ready) {
    const auto result = decoder_.feed(input);
    if (result == wire::MessageDecoder::Result::too_large) {
      return end_with(
          0, v1::ERROR_TOO_LARGE,
          fmt::format("a message of {} bytes was announced, at most {} are allowed{}: "
                      "check that the client speaks dtact.proto with big-endian "
                      "lengths",
                      decoder_.announced(), decoder_.cap(), grant_ ? "" : " before Hello"));
    }
    note_held();
    if (result == wire::MessageDecoder::Result::need_more) return;
    on_message();
  }
}

void Session::note_held() {
  const auto large = [](std::size_t bytes) { return bytes > kSmall ? bytes : 0; };
  const std::size_t arriving = large(decoder_.held());
  const std::size_t before = std::exchange(arriving_, arriving);
  if (before == 0 && arriving > 0) arm_timer(kArrival, "a large message did not arrive in time");
  if (before > 0 && arriving == 0) timer_.cancel();
  admission_.hold(this, peer().host, arriving + large(outbox_.waiting_bytes()), [this] {
    close("the large messages of all clients took too much memory, most of it here",
          LogLevel::warning);
  });
}

void Session::on_message() {
  const std::size_t small_ones = 1 + decoder_.message().size() / kSmall;
  const auto cost = static_cast<double>(small_ones);
  if (!requests_.take(cost)) {
    return end_with(0, v1::ERROR_FLOOD,
                    fmt::format("more than {} requests a second came, each 64 kB of one counted: "
                                "send them more slowly or raise the daemon's max_requests_per_s",
                                config_.max_requests_per_s));
  }
  if (decoder_.message().size() > kSmall && !is_plain_upload(decoder_.message())) {
    return end_with(0, v1::ERROR_TOO_LARGE,
                    fmt::format("a message of {} bytes came: only upload_calibration may have more "
                                "than {}, with nothing but id and on_behalf_of beside it",
                                decoder_.message().size(), kSmall));
  }
  v1::ClientMessage message;
  const bool parsed = message.ParseFromString(decoder_.message());
  decoder_.release();
  note_held();
  if (!parsed) {
    return end_with(0, v1::ERROR_BAD_MESSAGE,
                    "that was not a ClientMessage: check the client's copy of dtact.proto");
  }
  if (message.id() == 0) {
    return end_with(0, v1::ERROR_BAD_MESSAGE, "the request has id 0: ids begin with 1");
  }
  if (state_ == State::fresh) {
    if (!message.has_hello()) {
      return end_with(message.id(), v1::ERROR_VERSION,
                      "the first message was not Hello: send it to agree on a version");
    }
    return on_hello(message.id(), message.hello());
  }
  if (message.request_case() == v1::ClientMessage::REQUEST_NOT_SET) {
    return reply_error(message.id(), v1::ERROR_UNSUPPORTED,
                       "the message has no request that this daemon knows: ask only for what "
                       "HelloReply.features lists, or update dtactd");
  }
  if (message.has_hello()) {
    return reply_error(message.id(), v1::ERROR_INVALID,
                       "hello: sent already; it is the first message only");
  }
  if (const Rights needed = rights_for(message.request_case()); rights() < needed) {
    log_change(config_.log, describe_change(*this, message), denial(needed), LogSubject::denied);
    return reply_error(message.id(), v1::ERROR_DENIED, denial(needed));
  }
  if (const auto host = host_.lock()) host->on_request(shared_from_this(), message);
}

void Session::on_hello(std::uint64_t id, const v1::Hello& hello) {
  if (hello.major() != wire::kMajor) {
    return end_with(id, v1::ERROR_VERSION,
                    fmt::format("the client speaks version {} and this daemon version {}: install "
                                "the same release on both sides",
                                hello.major(), wire::kMajor));
  }
  if (hello.program().size() > wire::kMaxProgramName) {
    return reply_error(id, v1::ERROR_INVALID,
                       fmt::format("hello.program: {} bytes, at most {} are allowed",
                                   hello.program().size(), wire::kMaxProgramName));
  }
  if (hello.token().size() > wire::kMaxToken) {
    return reply_error(id, v1::ERROR_INVALID,
                       fmt::format("hello.token: {} bytes, at most {} are allowed",
                                   hello.token().size(), wire::kMaxToken));
  }
  const auto verdict = admission_.enter(peer(), hello.token());
  if (verdict.error_code == v1::ERROR_DENIED) return deny(id, verdict);
  // It is the connection that is refused, as by daemons that said so before Hello: id 0.
  if (!verdict.grant) return end_with(0, verdict.error_code, verdict.sentence);
  grant_ = verdict.grant;
  transport_->on_authenticated();
  timer_.cancel();
  state_ = State::ready;
  decoder_.set_cap(wire::kMaxMessage);
  program_ = base::printable(hello.program());
  config_.log({LogLevel::info,
               fmt::format("client {} ({}) connected{}{}", peer().address, program_,
                           grant_->name.empty() ? "" : " as ", grant_->name),
               peer().address, LogSubject::general, grant_->name});
  v1::ServerMessage message;
  message.mutable_reply()->set_id(id);
  auto& reply = *message.mutable_reply()->mutable_hello();
  reply.set_major(wire::kMajor);
  reply.set_minor(wire::kMinor);
  reply.set_program(config_.program);
  for (const char* feature : config_.features) reply.add_features(feature);
  reply.set_rights(static_cast<v1::Rights>(grant_->rights));
  reply.set_name(config_.name);
  reply.set_instance(config_.instance);
  auto& frame = *reply.mutable_surface_frame();
  frame.set_frame_id(config_.frame_id);
  frame.set_right_handed(true);
  frame.set_mirrored_from_outside(true);
  frame.set_origin("centre");
  frame.set_axes("x right, y down, z towards the object, as the camera sees it");
  const auto host = host_.lock();
  if (host != nullptr) host->introduce(reply);
  send(message);
  if (host != nullptr) host->on_authenticated();
}

void Session::deny(std::uint64_t id, const Admission::Verdict& verdict) {
  state_ = State::denied;
  // Before the delay: a client that does not wait for the answer is logged, too.
  log_refusal(verdict.sentence);
  timer_.expires_after(verdict.delay);
  timer_.async_wait(
      [self = shared_from_this(), id, sentence = verdict.sentence](const error_code& error) {
        if (!error && self->state_ == State::denied) self->end(id, v1::ERROR_DENIED, sentence);
      });
}

std::string Session::identity() const {
  const std::string token = token_name();
  return fmt::format("{} ({}{}{})", peer().address, program_, token.empty() ? "" : ", token ",
                     token);
}

void Session::end_if_revoked() {
  if (state_ != State::ready || !grant_ || admission_.still_allows(*grant_)) return;
  end_with(
      0, v1::ERROR_DENIED,
      "this client's token was revoked, or given other rights: connect with one that is in the "
      "daemon's token file");
}

LogSubject Session::subject() const noexcept {
  return grant_ ? LogSubject::general : LogSubject::unauthenticated;
}

void Session::reply_error(std::uint64_t id, int error_code_, const std::string& sentence) {
  v1::ServerMessage message;
  message.mutable_reply()->set_id(id);
  message.mutable_reply()->mutable_error()->set_code(static_cast<v1::ErrorCode>(error_code_));
  message.mutable_reply()->mutable_error()->set_message(sentence);
  send(message);
}

void Session::log_refusal(const std::string& sentence) {
  config_.log({LogLevel::warning, fmt::format("client {}: {}", peer().address, sentence),
               peer().address, subject(), token_name()});
}

void Session::end_with(std::uint64_t id, int error_code_, const std::string& sentence) {
  log_refusal(sentence);
  end(id, error_code_, sentence);
}

void Session::end(std::uint64_t id, int error_code_, const std::string& sentence) {
  reply_error(id, error_code_, sentence);
  if (state_ == State::closed) return;
  // Closing at once, with bytes unread, would reset the connection and take the answer with it: so
  // the sending side ends first, and what still comes is read and thrown away for a while.
  state_ = State::ending;
  decoder_.release();
  note_held();
  arm_timer(kLinger, "ended");
  outbox_.finish();
}

void Session::send(const v1::ServerMessage& message, bool first) {
  if (state_ == State::closed || state_ == State::ending) return;
  const std::size_t size = message.ByteSizeLong();
  if (size > wire::kMaxMessage) {
    return reply_error(
        message.reply().id(), v1::ERROR_TOO_LARGE,
        fmt::format("the answer has {} bytes, at most {} are allowed: what was asked "
                    "for cannot be sent whole",
                    size, wire::kMaxMessage));
  }
  if (!outbox_.push(message, first)) {
    close(fmt::format("{} lay unread", outbox_.backlog()), LogLevel::warning);
  }
}

void Session::subscribe(const Subscription& subscription) {
  subscription_ = subscription;
  outbox_.drop_frame();
  waiting_ = 0;
}

std::optional<FrameKind> Session::due(std::int64_t timestamp_ns, std::uint64_t missed) {
  if (state_ != State::ready) return std::nullopt;
  const Subscription::Due due = subscription_.next(timestamp_ns, missed);
  outbox_.count_dropped(due.missed);
  if (due.parts == 0) return std::nullopt;
  waiting_ =
      due.parts |
      (outbox_.frame_waits() || skipping_stalled_reader_ ? waiting_ : Subscription::Parts{0});
  skipping_stalled_reader_ = outbox_.stalled();
  if (skipping_stalled_reader_) {
    // The one that waits is old: the next after the reader goes on takes its place.
    outbox_.count_dropped(outbox_.frame_waits() ? 2 : 1);
    outbox_.drop_frame();
    return std::nullopt;
  }
  return subscription_.kind(waiting_);
}

void Session::send_frame(std::shared_ptr<const EncodedFrame> frame) {
  if (state_ == State::ready) outbox_.push(std::move(frame));
}

void Session::close(const std::string& reason, LogLevel level) {
  if (state_ == State::closed) return;
  const bool known = state_ == State::ready;
  state_ = State::closed;
  if (grant_) admission_.leave(peer());
  admission_.hold(this, peer().host, 0, {});
  transport_->close();
  timer_.cancel();
  outbox_.close();
  if (known || level != LogLevel::info) {
    config_.log({level,
                 fmt::format("client {} ({}) disconnected: {}; {} frames sent, {} dropped",
                             peer().address, program_, reason, outbox_.sent(), outbox_.dropped()),
                 peer().address, subject(), token_name()});
  }
  if (const auto host = host_.lock()) host->on_closed(*this);
}

}  // namespace dtact::net
