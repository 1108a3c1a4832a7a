#include "clients/cpp/convert.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "clients/cpp/errors.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"

namespace dtact::client {
namespace {

/// HEALTH_LIGHT_UNSETTLED → "light_unsettled"; a value of a newer daemon → "13".
std::string plain_name(std::string_view name, std::string_view prefix, int value) {
  if (name.empty()) return std::to_string(value);
  std::string text(name.substr(prefix.size()));
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

template <typename Message>
std::vector<std::string> health_of(const Message& message) {
  std::vector<std::string> names;
  for (const int value : message.health()) {
    names.push_back(plain_name(v1::Health_Name(static_cast<v1::Health>(value)), "HEALTH_", value));
  }
  return names;
}

std::string state_of(v1::State state) {
  return plain_name(v1::State_Name(state), "STATE_", static_cast<int>(state));
}

Contact to_contact(const v1::Contact& message) {
  return {message.touching(),     message.area_mm2(),   message.x_mm(),
          message.y_mm(),         message.deepest_mm(), message.deepest_x_mm(),
          message.deepest_y_mm(), message.volume_mm3()};
}

DepthMap to_depth(const v1::DepthMap& message) {
  DepthMap map;
  bool ok = false;
  switch (message.encoding()) {
    case v1::DEPTH_INT16:
      ok = wire::decode_int16(message.data(), message.width(), message.height(), map.values);
      break;
    case v1::DEPTH_DELTA_ZSTD:
      ok = wire::decode_delta_zstd(message.data(), message.width(), message.height(), map.values);
      break;
    default:
      break;
  }
  if (!ok) {
    throw ProtocolError(
        "a depth map of the daemon is damaged or in an unknown encoding: install "
        "the same release on both sides");
  }
  map.width = static_cast<int>(message.width());
  map.height = static_cast<int>(message.height());
  map.mm_per_px = message.mm_per_px();
  map.um_per_unit = message.um_per_unit();
  map.decimation = static_cast<int>(message.decimation());
  map.uncertainty_um = message.uncertainty_um();
  map.untrusted = static_cast<std::int16_t>(message.untrusted_value());
  return map;
}

CalibrationSummary to_summary(const v1::CalibrationSummary& message) {
  return {message.name(),          message.method(),  message.mm_per_px(),
          message.width(),         message.height(),  message.covered_from_mm(),
          message.covered_to_mm(), message.created(), message.frame_width(),
          message.frame_height()};
}

LumaMap to_luma(const v1::LumaMap& message) {
  const auto pixels = std::uint64_t{message.width()} * message.height();
  if (message.encoding() != v1::LUMA_GREY8 || message.data().size() != pixels) {
    throw ProtocolError(
        "a luma map of the daemon is damaged or in an unknown encoding: install "
        "the same release on both sides");
  }
  return {static_cast<int>(message.width()),
          static_cast<int>(message.height()),
          {message.data().begin(), message.data().end()}};
}

}  // namespace

Light to_light(const v1::LightState& message) {
  Light light{static_cast<std::uint8_t>(message.brightness()), {}};
  for (const auto& led : message.leds()) {
    light.leds.push_back({static_cast<std::uint8_t>(led.r()), static_cast<std::uint8_t>(led.g()),
                          static_cast<std::uint8_t>(led.b())});
  }
  return light;
}

Frame to_frame(const v1::Frame& message) {
  Frame frame;
  frame.sequence = message.sequence();
  frame.monotonic_ns = message.monotonic_ns();
  frame.wall_ns = message.wall_ns();
  frame.meaning = plain_name(v1::TimestampMeaning_Name(message.meaning()), "TIMESTAMP_",
                             static_cast<int>(message.meaning()));
  frame.ready_ns = message.ready_ns();
  frame.published_ns = message.published_ns();
  frame.health = health_of(message);
  frame.light = to_light(message.light());
  frame.contact = to_contact(message.contact());
  const auto& times = message.times();
  frame.times = {times.decode_ns(), times.activity_ns(), times.rectify_ns(), times.smooth_ns(),
                 times.list_ns(),   times.inspect_ns(),  times.publish_ns(), times.encode_ns()};
  if (message.has_depth()) frame.depth = to_depth(message.depth());
  if (message.has_luma()) frame.luma = to_luma(message.luma());
  frame.dropped = message.dropped();
  frame.frame_id = message.frame_id();
  return frame;
}

std::optional<Event> to_event(const v1::Event& message) {
  switch (message.what_case()) {
    case v1::Event::kContact:
      return ContactChanged{message.contact().sequence(), message.contact().monotonic_ns(),
                            to_contact(message.contact().contact())};
    case v1::Event::kLight:
      return LightChanged{to_light(message.light())};
    case v1::Event::kReference:
      return ReferenceTaken{message.reference().sequence(), message.reference().restored()};
    case v1::Event::kState:
      return StateChanged{state_of(message.state().state()), health_of(message.state())};
    case v1::Event::kCalibration:
      return CalibrationChanged{message.calibration().name()};
    case v1::Event::WHAT_NOT_SET:
      return std::nullopt;
  }
  return std::nullopt;
}

StoredCalibration to_stored(const v1::StoredCalibration& message) {
  StoredCalibration stored;
  stored.number = message.number();
  stored.name = message.name();
  stored.uploaded = message.uploaded();
  stored.current = message.current();
  stored.in_use = message.has_in_use() ? message.in_use() : message.current();
  if (message.has_summary()) stored.summary = to_summary(message.summary());
  stored.damage = message.damage();
  return stored;
}

Status to_status(const v1::Status& message) {
  Status status;
  status.state = state_of(message.state());
  status.health = health_of(message);
  status.advice = message.advice();
  const auto& camera = message.camera();
  status.camera = {camera.backend(),
                   camera.identity(),
                   camera.pixel_format(),
                   camera.width(),
                   camera.height(),
                   camera.fps(),
                   camera.condition(),
                   camera.remedy(),
                   camera.delivered(),
                   camera.lost(),
                   camera.skipped(),
                   camera.damaged(),
                   camera.damage().flagged(),
                   camera.damage().markers(),
                   camera.damage().too_short(),
                   camera.damage().undecodable(),
                   camera.disconnects(),
                   camera.moved(),
                   {}};
  for (const auto& control : camera.controls()) {
    status.camera.controls.push_back(
        {control.name(), control.value(), control.locked(), control.note()});
  }
  status.ring = {message.ring().backend(), message.ring().identity(), message.ring().message()};
  status.light = to_light(message.light());
  if (message.has_calibration()) {
    status.calibration = to_summary(message.calibration());
  }
  status.frames = message.frames();
  status.skipped = message.skipped();
  status.fps = message.fps();
  status.realtime_refused.assign(message.realtime_refused().begin(),
                                 message.realtime_refused().end());
  for (const auto& stage : message.stages()) {
    status.stages.push_back({stage.stage(), stage.p50_us(), stage.p99_us(), stage.max_us()});
  }
  for (const auto& client : message.clients()) {
    status.clients.push_back({client.address(), client.program(), client.sent(), client.dropped()});
  }
  status.version = message.version();
  status.uptime_s = message.uptime_s();
  status.encoded = message.encoded();
  status.light_followed = message.light_followed();
  const auto& usage = message.capture_thread();
  status.capture_thread = {usage.minor_faults(), usage.major_faults(), usage.waits(),
                           usage.preemptions()};
  return status;
}

}  // namespace dtact::client
