#include "daemon/net/commands.hpp"

#include <fmt/format.h>

#include <utility>

#include "daemon/net/hub.hpp"
#include "daemon/net/light_schemes.hpp"
#include "daemon/net/messages.hpp"
#include "daemon/serve/client_status.hpp"
#include "hal/base/clock.hpp"
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
      return fmt::format("set_light.scheme: \"{}\" is unknown; known are {}", request.scheme(),
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

}  // namespace

Commands::Commands(asio::io_context& io, asio::thread_pool& worker, const NetConfig& config,
                   Hub& hub, pipeline::Port& port, CalibrationStore& store)
    : config_(config),
      hub_(hub),
      port_(port),
      calibrations_(std::make_shared<CalibrationCommands>(io, worker, config, hub, port, store)) {}

void Commands::on_request(const std::shared_ptr<Session>& session,
                          const v1::ClientMessage& message) {
  const Requester requester(session, message, config_.log);
  switch (message.request_case()) {
    case v1::ClientMessage::kSubscribe:
      return subscribe(requester, message.subscribe());
    case v1::ClientMessage::kSetLight:
      return set_light(requester, message.set_light());
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
  if (!config_.realtime_refused.empty()) status.add_realtime_refused(config_.realtime_refused);
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
