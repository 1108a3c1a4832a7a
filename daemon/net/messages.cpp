#include "daemon/net/messages.hpp"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "daemon/net/advice.hpp"
#include "daemon/net/reconstruction_names.hpp"
#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

using pipeline::Health;
using pipeline::State;

// The wire's Health and State are the pipeline's plus one: 0 is "none" there.
constexpr bool matches(Health ours, v1::Health theirs) {
  return static_cast<int>(ours) + 1 == static_cast<int>(theirs);
}
static_assert(matches(Health::uncalibrated, v1::HEALTH_UNCALIBRATED));
static_assert(matches(Health::light_mismatch, v1::HEALTH_LIGHT_MISMATCH));
static_assert(matches(Health::not_realtime, v1::HEALTH_NOT_REALTIME));
static_assert(matches(Health::camera_shifted, v1::HEALTH_CAMERA_SHIFTED));
static_assert(matches(Health::camera_slow, v1::HEALTH_CAMERA_SLOW));
static_assert(matches(Health::exposure_unlocked, v1::HEALTH_EXPOSURE_UNLOCKED));
static_assert(matches(Health::machine_slow, v1::HEALTH_MACHINE_SLOW));
static_assert(pipeline::kHealthCount == v1::Health_MAX);

v1::State to_wire(State state) {
  switch (state) {
    case State::settling:
      return v1::STATE_SETTLING;
    case State::referencing:
      return v1::STATE_REFERENCING;
    case State::serving:
      return v1::STATE_SERVING;
    case State::uncalibrated:
      return v1::STATE_UNCALIBRATED;
    case State::camera_lost:
      return v1::STATE_CAMERA_LOST;
  }
  return v1::STATE_UNSPECIFIED;
}

v1::ControlVerdict to_wire(hal::ControlVerdict verdict) {
  switch (verdict) {
    case hal::ControlVerdict::refused:
      return v1::CONTROL_VERDICT_REFUSED;
    case hal::ControlVerdict::accepted:
      return v1::CONTROL_VERDICT_ACCEPTED;
    case hal::ControlVerdict::confirmed:
      return v1::CONTROL_VERDICT_CONFIRMED;
  }
  return v1::CONTROL_VERDICT_UNSPECIFIED;
}

v1::TimestampMeaning to_wire(hal::TimestampMeaning meaning) {
  switch (meaning) {
    case hal::TimestampMeaning::start_of_exposure:
      return v1::TIMESTAMP_START_OF_EXPOSURE;
    case hal::TimestampMeaning::first_packet:
      return v1::TIMESTAMP_FIRST_PACKET;
    case hal::TimestampMeaning::end_of_frame:
      return v1::TIMESTAMP_END_OF_FRAME;
    case hal::TimestampMeaning::arrival:
      return v1::TIMESTAMP_ARRIVAL;
  }
  return v1::TIMESTAMP_UNSPECIFIED;
}

v1::ContactAbsence to_wire(pipeline::ContactAbsence absence) {
  switch (absence) {
    case pipeline::ContactAbsence::none:
      return v1::CONTACT_ABSENCE_NONE;
    case pipeline::ContactAbsence::uncalibrated:
      return v1::CONTACT_ABSENCE_UNCALIBRATED;
    case pipeline::ContactAbsence::referencing:
      return v1::CONTACT_ABSENCE_REFERENCING;
    case pipeline::ContactAbsence::unasked:
      return v1::CONTACT_ABSENCE_UNASKED;
  }
  return v1::CONTACT_ABSENCE_NONE;
}

const char* name_of(hal::CameraState state) {
  switch (state) {
    case hal::CameraState::streaming:
      return "streaming";
    case hal::CameraState::stalled:
      return "stalled";
    case hal::CameraState::unplugged:
      return "unplugged";
    case hal::CameraState::busy:
      return "busy";
    case hal::CameraState::denied:
      return "denied";
    case hal::CameraState::ended:
      return "ended";
  }
  return "";
}

std::uint32_t clamp_ns(std::int64_t ns) {
  return static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(ns, 0, std::numeric_limits<std::uint32_t>::max()));
}

template <typename Message>
void fill_health(pipeline::HealthSet health, Message& out) {
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    if (health.has(static_cast<Health>(i))) out.add_health(static_cast<v1::Health>(i + 1));
  }
}

void fill_camera(const hal::CameraInfo& info, const hal::CameraReport& report,
                 v1::CameraStatus& out) {
  out.set_backend(info.backend);
  out.set_identity(info.identity);
  out.set_pixel_format(info.pixel_format);
  out.set_width(static_cast<std::uint32_t>(info.width));
  out.set_height(static_cast<std::uint32_t>(info.height));
  out.set_fps(info.fps);
  out.set_state(name_of(report.state));
  out.set_fix(report.fix);
  out.set_delivered(report.delivered);
  out.set_lost(report.lost);
  out.set_skipped(report.skipped);
  out.set_damaged(report.damaged);
  out.set_disconnects(report.disconnects);
  out.set_moved(report.moved);
  auto& damage = *out.mutable_damage();
  damage.set_flagged(report.damage.flagged);
  damage.set_markers(report.damage.markers);
  damage.set_too_short(report.damage.too_short);
  damage.set_undecodable(report.damage.undecodable);
  for (const auto& control : info.controls) {
    auto& to = *out.add_controls();
    to.set_name(control.name);
    to.set_value(control.value);
    to.set_locked(control.verdict != hal::ControlVerdict::refused);
    to.set_verdict(to_wire(control.verdict));
    to.set_note(control.note);
  }
  fill(info.settings, *out.mutable_settings());
}

v1::Surface::Shape to_wire(recon::Surface::Kind kind) {
  switch (kind) {
    case recon::Surface::Kind::plane:
      return v1::Surface::PLANE;
    case recon::Surface::Kind::sphere:
      return v1::Surface::SPHERE;
    case recon::Surface::Kind::cylinder:
      return v1::Surface::CYLINDER;
  }
  return v1::Surface::PLANE;
}

void fill(const recon::Surface& surface, v1::Surface& out) {
  out.set_shape(to_wire(surface.kind));
  out.set_radius_mm(surface.radius_mm);
  out.set_axis_deg(surface.axis_deg);
  out.set_air_mm(surface.air_mm);
  out.set_gel_mm(surface.gel_mm);
  out.set_refraction(surface.refraction);
  out.set_foot_x_mm(surface.view.foot_mm.x);
  out.set_foot_y_mm(surface.view.foot_mm.y);
  out.set_per_mm(surface.view.per_mm);
}

}  // namespace

void fill(const hal::Light& light, std::optional<std::int64_t> since_ns, v1::LightState& out) {
  out.set_brightness(light.brightness);
  if (since_ns) out.set_since_ns(*since_ns);
  out.set_gamma(light.gamma);
  for (const auto& led : light.leds) {
    auto& to = *out.add_leds();
    to.set_r(led.r);
    to.set_g(led.g);
    to.set_b(led.b);
  }
}

void fill(const hal::CameraSettings& settings, v1::CameraSettings& out) {
  const auto fill_one = [](const hal::CameraSetting& setting, v1::CameraSetting& to) {
    to.set_value(setting.value);
    to.set_minimum(setting.minimum);
    to.set_maximum(setting.maximum);
  };
  if (settings.exposure_us) fill_one(*settings.exposure_us, *out.mutable_exposure_us());
  if (settings.gain) fill_one(*settings.gain, *out.mutable_gain());
}

void fill(const pipeline::ContactSummary& contact, v1::Contact& out) {
  out.set_in_contact(contact.in_contact);
  out.set_threshold_mm(contact.threshold_mm);
  out.set_area_mm2(contact.area_mm2);
  out.set_x_mm(contact.x_mm);
  out.set_y_mm(contact.y_mm);
  out.set_deepest_mm(contact.deepest_mm);
  out.set_deepest_x_mm(contact.deepest_x_mm);
  out.set_deepest_y_mm(contact.deepest_y_mm);
  out.set_volume_mm3(contact.volume_mm3);
  if (contact.force) {
    out.set_force_n(contact.force->newtons);
    out.set_force_uncertainty_n(contact.force->uncertainty_n);
  }
  out.set_force_absence(static_cast<v1::ForceAbsence>(contact.force_absence));
}

void fill(const pipeline::DepthFrame& frame, v1::Frame& out) {
  out.set_sequence(frame.camera.sequence);
  out.set_monotonic_ns(frame.camera.timestamp_ns);
  out.set_wall_ns(frame.wall_ns);
  out.set_meaning(to_wire(frame.camera.meaning));
  out.set_ready_ns(frame.camera.ready_ns);
  out.set_published_ns(frame.done_ns);
  fill_health(frame.health, out);
  fill(frame.light, frame.light_since_ns, *out.mutable_light());
  out.set_contact_absence(to_wire(frame.contact_absence));
  if (frame.contact_absence == pipeline::ContactAbsence::none) {
    fill(frame.contact, *out.mutable_contact());
  }
  if (frame.has_depth && frame.surface != recon::Surface{}) {
    fill(frame.surface, *out.mutable_surface());
  }
}

void fill(const pipeline::StageTimes& times, std::int64_t encode_ns, v1::StageTimes& out) {
  out.set_decode_ns(clamp_ns(times.decode_ns));
  out.set_rectify_ns(clamp_ns(times.rectify_ns));
  out.set_smooth_ns(clamp_ns(times.smooth_ns));
  out.set_lut_ns(clamp_ns(times.lut_ns));
  out.set_activity_ns(clamp_ns(times.activity_ns));
  out.set_inspect_ns(clamp_ns(times.inspect_ns));
  out.set_publish_ns(clamp_ns(times.publish_ns));
  out.set_encode_ns(clamp_ns(encode_ns));
}

void fill(const pipeline::Status& status, v1::Status& out) {
  out.set_state(to_wire(status.state));
  fill_health(status.health, out);
  for (const int flag : out.health()) {
    out.add_fixes(fix(status, static_cast<Health>(flag - 1)));
  }
  out.set_advice(advice(status));
  fill_camera(status.camera, status.camera_report, *out.mutable_camera());
  out.mutable_ring()->set_backend(status.ring.backend);
  out.mutable_ring()->set_identity(status.ring.identity);
  out.mutable_ring()->set_message(status.ring_message);
  fill(status.light, status.light_since_ns, *out.mutable_light());
  if (status.calibration != nullptr) {
    fill(summarise(*status.calibration), *out.mutable_calibration());
  }
  fill(status.reconstruction, *out.mutable_reconstruction());
  out.set_frames(status.frames);
  out.set_skipped(status.skipped);
  out.set_fps(status.fps);
  for (const auto& refused : status.realtime) out.add_realtime_refused(refused);
  for (const auto& stage : status.stages) fill(stage, *out.add_stages());
  out.set_light_followed(status.light_followed);
  if (status.cpu) out.set_capture_cpu(static_cast<std::uint32_t>(*status.cpu));
  auto& usage = *out.mutable_capture_thread();
  usage.set_minor_faults(status.capture_thread.minor_faults);
  usage.set_major_faults(status.capture_thread.major_faults);
  usage.set_waits(status.capture_thread.waits);
  usage.set_preemptions(status.capture_thread.preemptions);
}

void fill(const CalibrationSummary& summary, v1::CalibrationSummary& out) {
  out.set_name(summary.name);
  out.set_method(summary.method);
  out.set_mm_per_px(summary.mm_per_px);
  out.set_width(static_cast<std::uint32_t>(summary.width));
  out.set_height(static_cast<std::uint32_t>(summary.height));
  out.set_covered_from_mm(summary.covered_from_mm);
  out.set_covered_to_mm(summary.covered_to_mm);
  out.set_created(summary.created);
  out.set_frame_width(static_cast<std::uint32_t>(summary.frame_width));
  out.set_frame_height(static_cast<std::uint32_t>(summary.frame_height));
  for (const int steps : summary.sharpen_steps) {
    out.add_sharpen_steps(static_cast<std::uint32_t>(steps));
  }
}

void fill(const StoredCalibration& stored, v1::StoredCalibration& out) {
  out.set_number(stored.number);
  out.set_name(stored.name);
  out.set_uploaded(stored.uploaded);
  out.set_current(stored.current);
  out.set_pinned(stored.pinned);
  if (stored.summary.has_value()) {
    fill(*stored.summary, *out.mutable_summary());
  } else {
    out.set_damage(stored.damage);
  }
}

void fill(const pipeline::StageStatistics& stage, v1::StagePercentiles& out) {
  out.set_stage(stage.stage);
  out.set_p50_us(stage.p50_us);
  out.set_p99_us(stage.p99_us);
  out.set_max_us(stage.max_us);
}

void fill(const pipeline::Stamp& at, v1::Event& out) {
  out.set_sequence(at.sequence);
  out.set_monotonic_ns(at.monotonic_ns);
  out.set_wall_ns(at.wall_ns);
}

bool fill(const pipeline::Event& event, v1::Event& out) {
  std::visit([&out](const auto& what) { fill(what.at, out); }, event);
  if (const auto* contact = std::get_if<pipeline::ContactChanged>(&event)) {
    auto& to = *out.mutable_contact();
    to.set_sequence(contact->at.sequence);
    to.set_monotonic_ns(contact->at.monotonic_ns);
    fill(contact->contact, *to.mutable_contact());
    to.mutable_contact()->set_in_contact(contact->in_contact);
  } else if (const auto* light = std::get_if<pipeline::LightChanged>(&event)) {
    fill(light->light, light->since_ns, *out.mutable_light());
  } else if (const auto* reference = std::get_if<pipeline::ReferenceTaken>(&event)) {
    out.mutable_reference()->set_sequence(reference->at.sequence);
    out.mutable_reference()->set_restored(reference->restored);
  } else if (const auto* state = std::get_if<pipeline::StateChanged>(&event)) {
    out.mutable_state()->set_state(to_wire(state->state));
    fill_health(state->health, *out.mutable_state());
  } else {
    return false;
  }
  return true;
}

}  // namespace dtact::net
