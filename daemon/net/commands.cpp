#include "daemon/net/commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <mutex>
#include <utility>

#include "daemon/net/hub.hpp"
#include "daemon/net/light_schemes.hpp"
#include "daemon/net/messages.hpp"
#include "daemon/serve/client_status.hpp"
#include "hal/base/clock.hpp"
#include "hal/base/rt_thread.hpp"
#include "hal/base/utf8.hpp"
#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

namespace asio = boost::asio;

/// `light` changed as `request` says, or the sentence that says what is wrong with it.
std::string change(const v1::SetLight& request, hal::Light& light) {
  if (request.has_brightness()) {
    if (request.brightness() > 255) {
      return fmt::format("set_light.brightness: {}; allowed are 0 to 255", request.brightness());
    }
    light.brightness = static_cast<std::uint8_t>(request.brightness());
  }
  if (request.has_scheme()) {
    const auto leds = scheme_leds(request.scheme());
    if (!leds.has_value()) {
      return fmt::format("set_light.scheme: \"{}\" is unknown; known are {}",
                         base::first_bytes(request.scheme(), wire::kMaxCalibrationName),
                         scheme_names());
    }
    light.leds = *leds;
  }
  if (request.leds().empty()) return {};
  if (request.leds_size() != hal::kLedCount) {
    return fmt::format("set_light.leds: {} colours, the ring has {}: send all or none",
                       request.leds_size(), hal::kLedCount);
  }
  for (int i = 0; i < hal::kLedCount; ++i) {
    const auto& led = request.leds(i);
    if (led.r() > 255 || led.g() > 255 || led.b() > 255) {
      return fmt::format("set_light.leds[{}]: {}, {}, {}; allowed are 0 to 255", i, led.r(),
                         led.g(), led.b());
    }
    light.leds[static_cast<std::size_t>(i)] = {static_cast<std::uint8_t>(led.r()),
                                               static_cast<std::uint8_t>(led.g()),
                                               static_cast<std::uint8_t>(led.b())};
  }
  return {};
}

/// What is wrong with a value for `name`; empty when nothing is.
std::string refusal_of(const char* name, double value,
                       const std::optional<hal::CameraSetting>& setting) {
  if (!setting) return fmt::format("set_camera.{}: this camera has no such control", name);
  if (value >= setting->minimum && value <= setting->maximum) return {};
  return fmt::format("set_camera.{}: {:g}; this camera has {:g} to {:g}", name, value,
                     setting->minimum, setting->maximum);
}

}  // namespace

/// The board's temperatures, read every two seconds on the worker: a firmware may be slow to say
/// them.
class Commands::Thermometer : public std::enable_shared_from_this<Thermometer> {
 public:
  Thermometer(asio::thread_pool& worker, std::filesystem::path folder)
      : folder_(std::move(folder)), timer_(worker) {}

  void start() {
    asio::post(timer_.get_executor(), [weak = weak_from_this()] { measure(weak); });
  }

  [[nodiscard]] std::vector<base::Temperature> latest() const {
    const std::lock_guard lock(mutex_);
    return latest_;
  }

 private:
  static void measure(const std::weak_ptr<Thermometer>& weak) {
    const auto self = weak.lock();
    if (self == nullptr) return;
    auto fresh = base::temperatures(self->folder_);
    {
      const std::lock_guard lock(self->mutex_);
      self->latest_ = std::move(fresh);
    }
    self->timer_.expires_after(std::chrono::seconds(2));
    self->timer_.async_wait([weak](const boost::system::error_code& error) {
      if (!error) measure(weak);
    });
  }

  std::filesystem::path folder_;
  asio::steady_timer timer_;  ///< Of the worker.
  mutable std::mutex mutex_;
  std::vector<base::Temperature> latest_;  ///< Under the mutex.
};

Commands::Commands(asio::io_context& io, asio::thread_pool& worker, const NetConfig& config,
                   Hub& hub, pipeline::Port& port, CalibrationStore& store)
    : config_(config),
      hub_(hub),
      port_(port),
      calibrations_(std::make_shared<CalibrationCommands>(io, worker, config, hub, port, store)),
      thermometer_(std::make_shared<Thermometer>(worker, config.thermal_folder)) {
  thermometer_->start();
}

void Commands::on_request(const std::shared_ptr<Session>& session,
                          const v1::ClientMessage& message) {
  const Requester requester(session, message, config_.log);
  switch (message.request_case()) {
    case v1::ClientMessage::kSubscribe:
      return subscribe(requester, message.subscribe());
    case v1::ClientMessage::kSetLight:
      return set_light(requester, message.set_light());
    case v1::ClientMessage::kSetCamera:
      return set_camera(requester, message.set_camera());
    case v1::ClientMessage::kRezero:
      return rezero(requester, message.rezero().force());
    case v1::ClientMessage::kGetStatus:
      return get_status(requester);
    case v1::ClientMessage::kGetCalibration:
      return calibrations_->get(requester, message.get_calibration());
    case v1::ClientMessage::kUploadCalibration:
      return calibrations_->upload(requester, message.upload_calibration());
    case v1::ClientMessage::kListCalibrations:
      return calibrations_->list(requester);
    case v1::ClientMessage::kActivateCalibration:
      return calibrations_->activate(requester, message.activate_calibration());
    case v1::ClientMessage::kPinCalibration:
      return calibrations_->pin(requester, message.pin_calibration());
    case v1::ClientMessage::kGetReference:
      return calibrations_->get_reference(requester);
    case v1::ClientMessage::kPing:
      return ping(requester);
    case v1::ClientMessage::kSetReconstruction:
      return calibrations_->set_reconstruction(requester, message.set_reconstruction());
    case v1::ClientMessage::kHello:
    case v1::ClientMessage::REQUEST_NOT_SET:
      return;  // The session's business.
  }
}

void Commands::subscribe(const Requester& requester, const v1::Subscribe& request) {
  const auto session = requester.session();
  if (session == nullptr) return;
  Subscription::Map map;
  if (const auto calibration = port_.status().calibration) {
    const CalibrationSummary summary = summarise(*calibration);
    map = {static_cast<std::uint32_t>(summary.width), static_cast<std::uint32_t>(summary.height)};
  }
  const auto made = Subscription::from(request, map);
  if (const auto* refusal = std::get_if<Refusal>(&made)) {
    return requester.refuse(refusal->code, refusal->sentence);
  }
  session->subscribe(std::get<Subscription>(made));
  hub_.update_want();
  requester.reply([](v1::Reply& out) { out.mutable_done(); });
}

void Commands::set_light(const Requester& requester, const v1::SetLight& request) {
  hal::Light light = port_.status().light_requested;
  const std::string wrong = change(request, light);
  if (!wrong.empty()) return requester.refuse(v1::ERROR_INVALID, wrong);
  (void)submit(port_, requester, pipeline::SetLight{light},
               [requester, light](const pipeline::CommandDone& done) {
                 requester.reply(done, [&](v1::Reply& out) {
                   fill(light, done.light_since_ns, *out.mutable_light());
                 });
               });
}

void Commands::set_camera(const Requester& requester, const v1::SetCamera& request) {
  const pipeline::Status now = port_.status();
  const hal::CameraSettings& has = now.camera.settings;
  if (now.state == pipeline::State::camera_lost && !has.exposure_us && !has.gain) {
    // Which settings it has is known once it has been opened.
    return requester.refuse(v1::ERROR_DEVICE, now.camera_report.fix);
  }
  pipeline::SetCamera command;
  std::string wrong;
  if (request.has_exposure_us()) {
    command.change.exposure_us = request.exposure_us();
    wrong = refusal_of("exposure_us", request.exposure_us(), has.exposure_us);
  }
  if (request.has_gain()) {
    command.change.gain = request.gain();
    if (wrong.empty()) wrong = refusal_of("gain", request.gain(), has.gain);
  }
  if (!wrong.empty()) return requester.refuse(v1::ERROR_INVALID, wrong);
  if (!command.change.exposure_us && !command.change.gain) {
    return requester.reply([&](v1::Reply& out) { fill(has, *out.mutable_camera()); });
  }
  (void)submit(port_, requester, command,
               [requester, &port = port_](const pipeline::CommandDone& done) {
                 requester.reply(done, [&](v1::Reply& out) {
                   fill(port.status().camera.settings, *out.mutable_camera());
                 });
               });
}

void Commands::rezero(const Requester& requester, bool force) {
  (void)submit(port_, requester, pipeline::Rezero{force},
               [requester](const pipeline::CommandDone& done) {
                 requester.reply(done, [](v1::Reply& out) { out.mutable_done(); });
               });
}

void Commands::get_status(const Requester& requester) {
  requester.reply([&](v1::Reply& out) { *out.mutable_status() = overview().status; });
}

Overview Commands::overview() const {
  Overview overview;
  pipeline::Status pipeline = port_.status();
  v1::Status& status = overview.status;
  fill(pipeline, status);
  overview.stages = std::move(pipeline.stages);
  overview.traffic = hub_.traffic();
  overview.reference_taken_ns = hub_.reference_taken_ns();
  overview.temperatures = thermometer_->latest();
  if (!overview.temperatures.empty()) {
    status.set_board_celsius(
        std::ranges::max_element(overview.temperatures, {}, &base::Temperature::celsius)->celsius);
  }
  if (!config_.realtime_refused.empty()) status.add_realtime_refused(config_.realtime_refused);
  if (base::was_demoted()) status.add_realtime_refused(base::demoted_sentence("network"));
  for (auto& stage : hub_.stages()) {
    fill(stage, *status.add_stages());
    overview.stages.push_back(std::move(stage));
  }
  status.set_encoded(hub_.encoded());
  for (const auto& session : hub_.sessions()) {
    if (session->ready()) fill(*session, *status.add_clients());
  }
  for (const auto& endpoint : hub_.endpoints()) fill(endpoint, *status.add_endpoints());
  status.set_version(config_.version);
  status.set_name(config_.name);
  status.set_serial(hub_.serial());
  const std::chrono::duration<double> uptime = std::chrono::steady_clock::now() - start_;
  status.set_uptime_s(uptime.count());
  return overview;
}

void Commands::ping(const Requester& requester) {
  requester.reply(
      [](v1::Reply& out) {
        auto& clock = base::system_clock();
        out.mutable_pong()->set_monotonic_ns(clock.monotonic_ns());
        out.mutable_pong()->set_wall_ns(clock.wall_ns());
      },
      true);
}

}  // namespace dtact::net
