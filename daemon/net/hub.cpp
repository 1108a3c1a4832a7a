#include "daemon/net/hub.hpp"

#include <fcntl.h>
#include <fmt/format.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <cerrno>
#include <system_error>

#include "daemon/net/commands.hpp"
#include "daemon/net/messages.hpp"
#include "daemon/pipeline/statistics.hpp"
#include "hal/base/clock.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

/// The hub's own descriptor of the pipeline's eventfd: Asio closes what it watches.
int duplicate(int fd) {
  const int copy = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);
  if (copy < 0) {
    throw std::system_error(errno, std::generic_category(), "cannot watch the pipeline's events");
  }
  return copy;
}

void add(const Session& session, Traffic& to) {
  to.frames += session.outbox().sent();
  to.dropped += session.outbox().dropped();
  to.bytes += session.outbox().sent_bytes();
}

}  // namespace

Hub::Hub(asio::io_context& io, const NetConfig& config, pipeline::Port& port)
    : io_(io),
      config_(config),
      port_(port),
      events_(io, duplicate(port.event_fd())),
      encoder_(config.frame_id) {
  events_.native_non_blocking(true);
}

void Hub::start(Commands& commands) {
  commands_ = &commands;
  update_want();
  wait();
}

void Hub::stop() {
  error_code ignored;
  events_.close(ignored);
  session_list_.dismiss("the daemon ends");
  port_.want({});
}

void Hub::wait() {
  events_.async_wait(asio::posix::stream_descriptor::wait_read,
                     [weak = weak_from_this()](const error_code& error) {
                       const auto self = weak.lock();
                       if (error || self == nullptr) return;
                       std::uint64_t count = 0;
                       error_code empty;
                       // Its value says nothing that draining does not.
                       self->events_.read_some(asio::buffer(&count, sizeof count), empty);
                       if (!empty) self->drain();
                       if (self->events_.is_open()) self->wait();
                     });
}

void Hub::drain() {
  while (const auto event = port_.next_event()) on_event(*event);
  const auto* frame = port_.latest();
  if (frame == nullptr) return;
  on_frame(*frame);
  // There may be another one already. Requests come in between, even when encoding takes longer
  // than a frame.
  asio::post(io_, [weak = weak_from_this()] {
    const auto self = weak.lock();
    if (self != nullptr && self->events_.is_open()) self->drain();
  });
}

void Hub::on_event(const pipeline::Event& event) {
  if (const auto* done = std::get_if<pipeline::CommandDone>(&event)) {
    return done->command.then(*done);
  }
  if (const auto* reference = std::get_if<pipeline::ReferenceTaken>(&event)) {
    reference_taken_ns_.reset();
    if (!reference->restored) reference_taken_ns_ = reference->at.monotonic_ns;
    config_.log({.level = LogLevel::debug,
                 .text = reference->restored
                             ? "the last good reference is used until a new one is taken"
                             : "a new reference is taken",
                 .subject = LogSubject::change});
  }
  v1::ServerMessage message;
  if (fill(event, *message.mutable_event())) session_list_.broadcast(message);
}

void Hub::on_frame(const pipeline::DepthFrame& frame) {
  handover_.add(base::system_clock().monotonic_ns() - frame.done_ns);
  const std::uint64_t missed =
      number_ > 0 && frame.number > number_ ? frame.number - number_ - 1 : 0;
  number_ = frame.number;
  encoder_.begin(frame, calibration_number(frame.calibration));
  // Calibrations come into use in the order of their keys.
  if (frame.calibration) numbers_.erase(numbers_.begin(), numbers_.lower_bound(*frame.calibration));
  for (const auto& session : session_list_.all()) {
    const auto kind = session->due(frame.camera.timestamp_ns, missed);
    if (!kind) continue;
    auto encoded = encoder_.encode(*kind);
    if (encoded != nullptr) {
      session->send_frame(std::move(encoded));
      continue;
    }
    session->count_dropped();
    if (!std::exchange(reported_too_large_, true)) {
      config_.log({LogLevel::warning,
                   "a frame is above the wire's cap and is not sent: subscribe to depth or luma "
                   "alone, or choose a smaller camera mode"});
    }
  }
}

void Hub::admit(const std::shared_ptr<Session>& session) {
  ++gone_.connections;
  session_list_.admit(session);
}

std::optional<std::uint64_t> Hub::calibration_number(std::optional<std::uint64_t> key) const {
  if (!key) return std::nullopt;
  const auto found = numbers_.find(*key);
  if (found == numbers_.end()) return std::nullopt;
  return found->second;
}

void Hub::update_want() {
  pipeline::Wanted wanted;
  for (const auto& session : session_list_.all()) {
    if (!session->ready()) continue;
    wanted.contact = true;
    const auto parts = session->subscription().parts();
    // A summary includes the contact, which needs the depth.
    wanted.depth |= (parts & (Subscription::kDepth | Subscription::kSummary)) != 0;
    wanted.luma |= (parts & Subscription::kLuma) != 0;
    wanted.jpeg |= (parts & Subscription::kJpeg) != 0;
  }
  port_.want(wanted);
  encoder_.forget();
  reported_too_large_ = false;
}

Traffic Hub::traffic() const {
  Traffic all = gone_;
  for (const auto& session : session_list_.all()) add(*session, all);
  return all;
}

std::vector<pipeline::StageStatistics> Hub::stages() const {
  if (encoded() == 0) return {};
  return {pipeline::summarise("handover", handover_),
          pipeline::summarise("encode", encoder_.times())};
}

// Identified by what every camera has: a USB camera's port, a sensor's place on its
// bus.
std::string Hub::serial() const { return port_.status().camera.identity; }

void Hub::introduce(v1::HelloReply& reply) const {
  const pipeline::Status status = port_.status();
  reply.set_serial(status.camera.identity);
  reply.set_rezero_timeout_s(status.rezero_timeout_s);
}

void Hub::on_request(const std::shared_ptr<Session>& session, const v1::ClientMessage& message) {
  commands_->on_request(session, message);
}

void Hub::on_closed(const Session& session) {
  // Later, since a session may end while the list is being walked through.
  asio::post(io_, [weak = weak_from_this(), gone = &session] {
    const auto self = weak.lock();
    if (self == nullptr) return;
    const auto left = self->session_list_.release(gone);
    if (left == nullptr) return;
    add(*left, self->gone_);
    if (!left->authenticated()) ++self->gone_.refused;
    self->update_want();
  });
}

}  // namespace dtact::net
