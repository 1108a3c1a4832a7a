#include "daemon/net/advice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>

#include "proto/dtact.pb.h"

namespace dtact::net {
namespace {

using pipeline::Health;
using pipeline::State;

struct Fix {
  Health health;
  std::string_view sentence;
};

// In the order in which one should act: without a camera or a ring nothing else can be fixed.
constexpr std::array<Fix, pipeline::kHealthCount> kFixes = {{
    {Health::camera_fault, "The camera gives no usable frames."},
    {Health::ring_fault, "The LED ring cannot be written to."},
    {Health::uncalibrated,
     "No calibration: dtact-calibrate guided --radius-mm MM --mm-per-px S guides through one with "
     "a "
     "ball "
     "of known radius. From images: dtact-calibrate depth, then dtactctl calibration upload."},
    {Health::camera_mismatch,
     "Camera, mode or controls differ from the calibration's: restore them (dtactctl camera, the "
     "configuration) or calibrate again."},
    {Health::camera_shifted,
     "The gel's marks are not where they were at calibration: camera or gel has moved, and "
     "depth "
     "lies in the wrong place. Fix it in its mount and calibrate again."},
    {Health::light_mismatch,
     "The ring shows another light than at calibration: depth is scaled to it, with more noise; "
     "dtactctl led sets the light back."},
    {Health::starting, "Starting up: keep the surface free until the state is serving."},
    {Health::light_unsettled,
     "A light change is under way: keep the surface free until a new reference is taken."},
    {Health::reference_stale,
     "The reference belongs to another light: keep the surface free for a second or run "
     "dtactctl rezero."},
    {Health::reference_restored,
     "The last good reference is used after a start until a new one is taken: keep the surface "
     "free for a second or run dtactctl rezero."},
    {Health::beyond_calibration,
     "Pressed deeper than was calibrated: these pixels are marked untrusted; press less or "
     "calibrate with a deeper press."},
    {Health::image_repeated,
     "The camera repeats all or part of a picture: depth is old there; look at the USB cable, hub "
     "and processor load."},
    {Health::image_dark,
     "The picture is too dark to measure in: check the ring's power and wiring, its brightness "
     "(dtactctl led --brightness 255), the camera's exposure and that nothing covers the lens."},
    {Health::image_saturated,
     "Much of the picture is white: lower the light or the exposure and run dtactctl rezero."},
    {Health::light_drifted,
     "The light is not the reference's, or most of the surface is pressed, which looks alike: free "
     "the surface and run dtactctl rezero."},
    {Health::light_banded,
     "Bands move over the picture: make the exposure a whole number of the LEDs' PWM periods, or "
     "the brightness full."},
    {Health::image_noisy,
     "Pixels are too noisy: raise the light and lower the camera's gain; many dead pixels look "
     "alike."},
    {Health::exposure_unlocked,
     "The rest of the picture brightens as a part darkens: exposure or gain runs automatically, "
     "whatever the camera's controls say, and depth is wrong by as much. Switch it off with the "
     "camera's own program, or use another camera; then run dtactctl rezero."},
    {Health::camera_slow,
     "The camera takes fewer frames than its mode promises: set exposure_dynamic_framerate "
     "(automatic priority) to 0, make the exposure shorter than a frame, or give the camera more "
     "USB bandwidth (a port without a hub, MJPEG)."},
    {Health::machine_slow,
     "This machine is too slow for the camera's mode and leaves frames out: set a lower camera.fps "
     "or a smaller camera.width and camera.height, or reconstruct at a lower resolution (dtactctl "
     "reconstruction)."},
    {Health::frames_lost,
     "The camera loses frames on their way to this machine: look at the USB cable and hub."},
    {Health::not_realtime, "The capture thread runs without real-time scheduling."},
}};

void add(std::string& text, std::string_view sentence) {
  if (sentence.empty()) return;
  if (!text.empty()) text += ' ';
  text += sentence;
}

/// The report's own sentence where there is one: it knows the device.
std::string detail(const pipeline::Status& status, Health health) {
  if (health == Health::camera_slow) {
    return fmt::format("By their timestamps {:.1f} come in a second instead of {:g}.",
                       status.camera_fps, status.camera.fps);
  }
  if (health == Health::machine_slow) {
    return fmt::format("It processes {:.1f} of {:.1f} a second.", status.fps, status.camera_fps);
  }
  if (health == Health::camera_fault && status.camera_damaged) {
    const std::string& reason = status.camera_report.damage_reason;
    return fmt::format("All that come are damaged{}: {}.",
                       reason.empty() ? "" : fmt::format(" ({})", reason),
                       status.camera.backend == "replay"
                           ? "play a recording that is whole"
                           : "check its USB cable, hub and port, or set another pixel_format or a "
                             "lower camera.fps");
  }
  if (health == Health::camera_fault) return status.camera_report.fix;
  if (health == Health::camera_mismatch) return status.camera_report.moved;
  if (health == Health::camera_shifted) return status.camera_shift_message;
  if (health == Health::ring_fault) return status.ring_message;
  if (health == Health::not_realtime) {
    return status.realtime.empty()
               ? "It ran too long without waiting and lost its priority: lower camera.fps or the "
                 "picture's size, then restart dtactd."
               : "Start dtactd from its systemd unit or grant it LimitRTPRIO and LimitMEMLOCK.";
  }
  return {};
}

/// Start-up and a light change cannot end in a dark picture: waiting is no fix then.
bool waits_for_light(const pipeline::HealthSet& health, Health flag) {
  return health.has(Health::image_dark) &&
         (flag == Health::starting || flag == Health::light_unsettled);
}

/// "HEALTH_CAMERA_FAULT" without the enum's name, in small letters.
std::string short_name(std::string name) {
  name.erase(0, name.find('_') + 1);
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return name;
}

}  // namespace

// The wire's values are the pipeline's plus one (messages.cpp).
std::string health_name(Health health) {
  return short_name(v1::Health_Name(static_cast<v1::Health>(static_cast<int>(health) + 1)));
}

std::string state_name(State state) {
  return short_name(v1::State_Name(static_cast<v1::State>(static_cast<int>(state) + 1)));
}

std::string fix(const pipeline::Status& status, Health health) {
  if (waits_for_light(status.health, health))
    return "It waits for a picture that is bright enough.";
  std::string text(std::ranges::find(kFixes, health, &Fix::health)->sentence);
  add(text, detail(status, health));
  return text;
}

std::string advice(const pipeline::Status& status) {
  std::string text;
  if (status.state == State::camera_lost && !status.health.has(Health::camera_fault)) {
    add(text, "The camera is away.");
    add(text, status.camera_report.fix);
  }
  for (const auto& [health, _] : kFixes) {
    if (!status.health.has(health) || waits_for_light(status.health, health)) continue;
    add(text, fix(status, health));
  }
  add(text, status.storage_message);
  return text;
}

}  // namespace dtact::net
