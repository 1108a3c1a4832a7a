#include "clients/cpp/client.hpp"

#include <sys/eventfd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "clients/cpp/channel.hpp"
#include "clients/cpp/session.hpp"
#include "hal/base/unique_fd.hpp"

namespace dtact::client {
namespace {

/// Calibrations are parsed, and some written to a disk, before the request is answered.
constexpr std::chrono::seconds kParseTimeout{30};
std::chrono::milliseconds parse_timeout(const Options& options) {
  return std::max<std::chrono::milliseconds>(options.timeout, kParseTimeout);
}

void call(const Handlers& handlers, const Item& item) {
  if (const auto* frame = std::get_if<v1::Frame>(&item)) {
    if (handlers.frame) handlers.frame(*frame);
  } else if (const auto* event = std::get_if<v1::Event>(&item)) {
    if (handlers.event) handlers.event(*event);
  } else if (handlers.reconnected) {
    handlers.reconnected(std::get<Reconnected>(item));
  }
}

}  // namespace

v1::Subscribe depth_stream() {
  v1::Subscribe subscription;
  subscription.set_depth(v1::DEPTH_INT16);
  return subscription;
}

Client::Client(const Options& options) : session_(std::make_unique<Session>(options)) {}

Client::~Client() = default;
Client::Client(Client&&) noexcept = default;
Client& Client::operator=(Client&&) noexcept = default;

const v1::HelloReply& Client::server() const noexcept { return session_->server(); }
bool Client::has_feature(const std::string& name) const {
  const auto& features = session_->server().features();
  return std::ranges::find(features, name) != features.end();
}
bool Client::same_machine() const noexcept { return session_->local(); }
int Client::native_handle() const noexcept { return session_->native_handle(); }

void Client::subscribe(const v1::Subscribe& subscription) { session_->subscribe(subscription); }

v1::LightState Client::set_light(const v1::SetLight& change) {
  v1::ClientMessage message;
  *message.mutable_set_light() = change;
  return session_->request(message, session_->options().timeout).light();
}

void Client::rezero(bool force) {
  v1::ClientMessage message;
  message.mutable_rezero()->set_force(force);
  // On top of the timeout: the daemon averages frames before it answers.
  // Both bounded, so that the sum is a number of milliseconds whatever each of them is.
  constexpr std::chrono::milliseconds kLongest = std::chrono::years(100);
  const auto within = std::chrono::milliseconds(
      std::llround(std::clamp(server().rezero_timeout_s(), 0.0, 1e6) * 1e3));
  (void)session_->request(message, std::min(session_->options().timeout, kLongest) + within);
}

v1::CameraSettings Client::set_camera(const v1::SetCamera& change) {
  v1::ClientMessage message;
  *message.mutable_set_camera() = change;
  return session_->request(message, session_->options().timeout).camera();
}

v1::Reconstruction Client::set_reconstruction(const v1::SetReconstruction& change) {
  v1::ClientMessage message;
  *message.mutable_set_reconstruction() = change;
  return session_->request(message, session_->options().timeout).reconstruction();
}

v1::Status Client::status() {
  v1::ClientMessage message;
  message.mutable_get_status();
  return session_->request(message, session_->options().timeout).status();
}

v1::ReferenceImage Client::reference() {
  v1::ClientMessage message;
  message.mutable_get_reference();
  return std::move(*session_->request(message, session_->options().timeout).mutable_reference());
}

v1::Pong Client::ping() {
  v1::ClientMessage message;
  message.mutable_ping();
  return session_->request(message, session_->options().timeout).pong();
}

v1::CalibrationFiles Client::calibration(std::optional<std::uint64_t> number) {
  v1::ClientMessage message;
  auto& request = *message.mutable_get_calibration();
  if (number.has_value()) request.set_number(*number);
  return std::move(*session_->request(message, session_->options().timeout).mutable_calibration());
}

std::vector<v1::StoredCalibration> Client::calibrations() {
  v1::ClientMessage message;
  message.mutable_list_calibrations();
  v1::Reply reply = session_->request(message, parse_timeout(session_->options()));
  auto& calibrations = *reply.mutable_calibrations()->mutable_calibrations();
  return {calibrations.begin(), calibrations.end()};
}

v1::Done Client::upload_calibration(const v1::UploadCalibration& files) {
  v1::ClientMessage message;
  *message.mutable_upload_calibration() = files;
  return session_->request(message, parse_timeout(session_->options())).done();
}

void Client::activate_calibration(std::uint64_t number) {
  v1::ClientMessage message;
  message.mutable_activate_calibration()->set_number(number);
  (void)session_->request(message, parse_timeout(session_->options()));
}

void Client::pin_calibration(std::uint64_t number, bool pinned) {
  v1::ClientMessage message;
  message.mutable_pin_calibration()->set_number(number);
  message.mutable_pin_calibration()->set_pinned(pinned);
  (void)session_->request(message, session_->options().timeout);
}

std::optional<Item> Client::next(std::chrono::milliseconds timeout) {
  return session_->next({after(timeout)});
}

void Client::run(const Handlers& handlers, const std::stop_token& stop) {
  const base::UniqueFd wake(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
  if (!wake) throw Error("no descriptor is left for waiting: raise the limit (ulimit -n)");
  const std::stop_callback on_stop(stop, [&wake] { (void)::eventfd_write(wake.get(), 1); });
  while (!stop.stop_requested()) {
    const auto item = session_->next({std::chrono::steady_clock::time_point::max(), wake.get()});
    if (item.has_value()) call(handlers, *item);
  }
}

}  // namespace dtact::client
