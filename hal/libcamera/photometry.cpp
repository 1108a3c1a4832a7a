#include "hal/libcamera/photometry.hpp"

#include <fmt/format.h>
#include <libcamera/control_ids.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <utility>

#include "hal/live/exposure.hpp"

namespace dtact::hal::libcamera_backend {
namespace {

namespace lc = libcamera;

struct Control {
  const char* name;
  const lc::ControlId& id;
  std::optional<double> off;  ///< The value that keeps it from acting by itself.
};

constexpr const char* kExposure = "exposure_time";
constexpr const char* kGain = "analogue_gain";
/// Asked for as FrameDurationLimits, read as FrameDuration.
constexpr const char* kFrameDuration = "frame_duration";

constexpr const char* kNotSaidYet = "set; the frames have not said yet what came of it";

/// Microseconds. The initial value of a Pi's cameras without a request (ipa_base.cpp:
/// defaultExposureTime); their list of controls has no default.
constexpr double kDefaultExposure = 20000;
/// Share of a frame's duration. Sensors need the rest between two exposures: 4 to some 40 lines
/// of about a thousand (cam_helper_*.cpp: frameIntegrationDiff).
constexpr double kMaxFrameShare = 0.9;
/// Microseconds: sensors count exposure in lines, of which the longest last about so long.
constexpr std::int64_t kLine = 64;

const std::array<Control, 10>& known_controls() {
  static const std::array<Control, 10> controls{{
      {"auto_exposure", lc::controls::AeEnable, 0},
      {"auto_white_balance", lc::controls::AwbEnable, 0},
      {"auto_focus", lc::controls::AfMode, 0},  // AfModeManual
      {kExposure, lc::controls::ExposureTime, std::nullopt},
      {kGain, lc::controls::AnalogueGain, std::nullopt},
      {"lens_position", lc::controls::LensPosition, std::nullopt},
      {"brightness", lc::controls::Brightness, std::nullopt},
      {"contrast", lc::controls::Contrast, std::nullopt},
      {"saturation", lc::controls::Saturation, std::nullopt},
      {"sharpness", lc::controls::Sharpness, std::nullopt},
  }};
  return controls;
}

const Control* find(const std::string& name) {
  const auto& controls = known_controls();
  const auto* it = std::ranges::find_if(controls, [&](const auto& c) { return name == c.name; });
  return it == controls.end() ? nullptr : it;
}

std::optional<double> number(const lc::ControlValue& value) {
  if (value.isArray()) return std::nullopt;
  switch (value.type()) {
    case lc::ControlTypeBool:
      return value.get<bool>() ? 1 : 0;
    case lc::ControlTypeInteger32:
      return value.get<std::int32_t>();
    case lc::ControlTypeInteger64:
      return static_cast<double>(value.get<std::int64_t>());
    case lc::ControlTypeFloat:
      return value.get<float>();
    default:
      return std::nullopt;
  }
}

lc::ControlValue value_of(lc::ControlType type, double value) {
  lc::ControlValue result;
  if (type == lc::ControlTypeBool) {
    result.set<bool>(value != 0);
  } else if (type == lc::ControlTypeFloat) {
    result.set<float>(static_cast<float>(value));
  } else {
    result.set<std::int32_t>(static_cast<std::int32_t>(std::llround(value)));
  }
  return result;
}

std::int64_t report_value(const lc::ControlId& id, double value) {
  return std::llround(id.type() == lc::ControlTypeFloat ? value * 1000 : value);
}

/// A hundredth of the value, or one unit, is the same value.
bool same(std::int64_t a, std::int64_t b) {
  return std::llabs(a - b) <= std::max<std::int64_t>(1, std::llabs(b) / 100);
}

/// Whether `got` is what the sensor's steps make of `asked`.
bool nearest(const std::string& name, std::int64_t got, std::int64_t asked) {
  if (name != kExposure) return same(got, asked);
  return std::llabs(got - asked) <= std::max(kLine, asked / 20);
}

/// What became of a control, as the first frames taken with it say.
void settle(CameraControl& entry, std::int64_t got) {
  const std::int64_t asked = std::exchange(entry.value, got);
  const bool as_asked = nearest(entry.name, got, asked);
  entry.verdict = as_asked ? ControlVerdict::confirmed : ControlVerdict::refused;
  entry.note.clear();
  if (as_asked) {
    if (entry.name == kExposure) {
      entry.note = live::rounding_note(static_cast<double>(asked), static_cast<double>(got));
    }
  } else if (entry.name == kFrameDuration) {
    entry.note = fmt::format(
        "the sensor runs at {:.1f} frames a second, not at {:.1f}: set "
        "camera.fps to that, or another camera.width and camera.height",
        1e6 / static_cast<double>(got), 1e6 / static_cast<double>(asked));
  } else if (entry.name == kExposure) {
    entry.note = fmt::format(
        "{} us were asked for: the frame leaves no more; lower "
        "camera.libcamera.exposure_us or camera.fps",
        asked);
  } else {
    entry.note = fmt::format("{} is {} after it was set to {}", entry.name, got, asked);
  }
}

std::optional<unsigned> id_of_reading(const std::string& name) {
  if (name == kFrameDuration) return lc::controls::FrameDuration.id();
  const Control* control = find(name);
  return control != nullptr ? std::optional(control->id.id()) : std::nullopt;
}

/// The value to lock what the configuration says nothing of.
std::optional<double> default_of(const Control& control, const lc::ControlInfo& offered,
                                 double frame_us) {
  std::optional<double> value = number(offered.def());
  // Longer ones are clipped without a word (ipa_base.cpp: applyAGC()).
  if (control.name == std::string(kExposure)) {
    value = std::min(value.value_or(kDefaultExposure), kMaxFrameShare * frame_us);
  }
  if (!value && control.name == std::string(kGain)) value = number(offered.min());
  return value;
}

}  // namespace

PhotometricLock::PhotometricLock(const LibcameraConfig& config, double fps)
    : config_(config),
      exposure_us_(live::exposure_us("camera.libcamera", config.exposure_us,
                                     config.exposure_pwm_periods, config.pwm_hz)),
      fps_(fps) {
  if (exposure_us_ * fps_ > 1e6) {
    throw std::runtime_error(
        fmt::format("camera.libcamera: an exposure of {:g} us is longer than a frame at camera.fps "
                    "= {:g} ({:.0f} us): lower exposure_us, exposure_pwm_periods or camera.fps",
                    exposure_us_, fps_, 1e6 / fps_));
  }
  for (const auto& [name, value] : config.controls) {
    if (find(name) != nullptr && name != kExposure) continue;
    std::string names;
    for (const Control& c : known_controls()) {
      if (c.name == std::string(kExposure)) continue;
      names += fmt::format("{}{}", names.empty() ? "" : ", ", c.name);
    }
    throw std::runtime_error(fmt::format(
        "camera.libcamera.controls.{}: not a control of the lock; allowed are {} (exposure has its "
        "own key, exposure_us)",
        name, names));
  }
}

PhotometricLock::RequestedControls PhotometricLock::requested_controls(
    const lc::ControlInfoMap& offered) const {
  // libcamera 0.0.3: count() counts every control there is, not the camera's, and find() needs
  // some.
  const auto find_offered = [&](const lc::ControlId& id) {
    return offered.empty() ? offered.end() : offered.find(id.id());
  };
  RequestedControls requested_controls{lc::ControlList(lc::controls::controls), {}};
  for (const Control& control : known_controls()) {
    const auto info = find_offered(control.id);
    const auto configured = config_.controls.find(control.name);
    std::optional<double> value = control.off;
    if (configured != config_.controls.end()) value = configured->second;
    if (control.name == std::string(kExposure) && exposure_us_ > 0) value = exposure_us_;
    const bool asked = value && value != control.off;

    CameraControl entry;
    entry.name = control.name;
    if (info == offered.end()) {
      if (!asked) continue;
      entry.note = fmt::format("this camera has no {}", control.name);
      requested_controls.controls.push_back(std::move(entry));
      continue;
    }
    if (!value) value = default_of(control, info->second, 1e6 / fps_);
    if (!value) continue;  // the pipeline names no default to go back to
    const std::optional<double> least = number(info->second.min());
    const std::optional<double> most = number(info->second.max());
    if ((least && *value < *least) || (most && *most > 0 && *value > *most)) {
      entry.note = fmt::format("{} = {} is outside this camera's {} to {}", control.name, *value,
                               least.value_or(0), most.value_or(0));
    } else {
      requested_controls.list.set(control.id.id(), value_of(control.id.type(), *value));
      entry.value = report_value(control.id, *value);
      entry.verdict = ControlVerdict::accepted;
      entry.note = kNotSaidYet;
    }
    requested_controls.controls.push_back(std::move(entry));
  }
  if (find_offered(lc::controls::FrameDurationLimits) != offered.end()) {
    const auto us = static_cast<std::int64_t>(std::llround(1e6 / fps_));
    requested_controls.list.set(lc::controls::FrameDurationLimits, {us, us});
    requested_controls.controls.push_back({kFrameDuration, us, ControlVerdict::accepted,
                                           "set; the frames have not said yet how long they last"});
  }
  return requested_controls;
}

CameraSettings PhotometricLock::settings(const lc::ControlInfoMap& offered,
                                         const std::vector<CameraControl>& controls) const {
  const auto setting = [&](const char* name, double maximum) -> std::optional<CameraSetting> {
    const auto now = std::ranges::find(controls, name, &CameraControl::name);
    if (offered.empty() || now == controls.end()) return std::nullopt;
    const auto info = offered.find(find(name)->id.id());
    if (info == offered.end()) return std::nullopt;
    const double most = number(info->second.max()).value_or(0);
    return CameraSetting{0, number(info->second.min()).value_or(0),
                         most > 0 ? std::min(most, maximum) : maximum};
  };
  constexpr double kMaxGain = 1000;  // where the camera names none
  CameraSettings settings{setting(kExposure, kMaxFrameShare * 1e6 / fps_),
                          setting(kGain, kMaxGain)};
  read_back(controls, settings);
  return settings;
}

void PhotometricLock::read_back(const std::vector<CameraControl>& controls,
                                CameraSettings& settings) {
  for (const CameraControl& control : controls) {
    const auto value = static_cast<double>(control.value);
    if (control.name == kExposure && settings.exposure_us) settings.exposure_us->value = value;
    if (control.name == kGain && settings.gain) settings.gain->value = value / 1000;
  }
}

lc::ControlList PhotometricLock::changed_controls(const CameraChange& change,
                                                  std::vector<CameraControl>& controls) {
  lc::ControlList list(lc::controls::controls);
  const auto set_one = [&](const char* name, const std::optional<double>& value) {
    if (!value) return;
    const lc::ControlId& id = find(name)->id;
    list.set(id.id(), value_of(id.type(), *value));
    const auto entry = std::ranges::find(controls, name, &CameraControl::name);
    if (entry == controls.end()) return;
    entry->value = report_value(id, *value);
    entry->verdict = ControlVerdict::accepted;
    entry->note = kNotSaidYet;
  };
  set_one(kExposure, change.exposure_us);
  set_one(kGain, change.gain);
  return list;
}

void PhotometricLock::read(const lc::ControlList& metadata, Readings& readings) {
  const auto note = [&](const lc::ControlId& id) {
    if (!metadata.contains(id.id())) return;
    const auto value = number(metadata.get(id.id()));
    if (value) readings[id.id()] = report_value(id, *value);
  };
  for (const Control& control : known_controls()) note(control.id);
  note(lc::controls::FrameDuration);
}

std::string PhotometricLock::compare(const Readings& readings,
                                     std::vector<CameraControl>& controls) {
  std::string moved;
  for (CameraControl& entry : controls) {
    const std::optional<unsigned> id = id_of_reading(entry.name);
    if (!id || entry.verdict == ControlVerdict::refused) continue;
    const auto reading = readings.find(*id);
    if (reading == readings.end()) {
      if (entry.verdict == ControlVerdict::accepted) {
        entry.note = "set; this camera's frames do not say what came of it";
      }
    } else if (entry.verdict == ControlVerdict::accepted) {
      settle(entry, reading->second);
    } else if (!same(reading->second, entry.value)) {
      moved += fmt::format("{}{} is {} though it was {}", moved.empty() ? "" : "; ", entry.name,
                           reading->second, entry.value);
    }
  }
  return moved;
}

}  // namespace dtact::hal::libcamera_backend
