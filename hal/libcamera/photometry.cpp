#include "hal/libcamera/photometry.hpp"

#include <fmt/format.h>
#include <libcamera/control_ids.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <stdexcept>

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

const std::array<Control, 10>& known_controls() {
  static const std::array<Control, 10> controls{{
      {"auto_exposure", lc::controls::AeEnable, 0},
      {"auto_white_balance", lc::controls::AwbEnable, 0},
      {"auto_focus", lc::controls::AfMode, 0},  // AfModeManual
      {kExposure, lc::controls::ExposureTime, std::nullopt},
      {"analogue_gain", lc::controls::AnalogueGain, std::nullopt},
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

/// Sensors have steps: a hundredth of the value, or one unit, is the same value.
bool same(std::int64_t a, std::int64_t b) {
  return std::llabs(a - b) <= std::max<std::int64_t>(1, std::llabs(b) / 100);
}

}  // namespace

PhotometricLock::PhotometricLock(const LibcameraConfig& config, double fps)
    : config_(config),
      exposure_us_(live::exposure_us("camera.libcamera", config.exposure_us,
                                     config.exposure_pwm_periods, config.pwm_hz)),
      fps_(fps) {
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

PhotometricLock::Wishes PhotometricLock::wishes(const lc::ControlInfoMap& offered) const {
  Wishes wishes{lc::ControlList(lc::controls::controls), {}};
  for (const Control& control : known_controls()) {
    const auto info = offered.find(control.id.id());
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
      wishes.controls.push_back(std::move(entry));
      continue;
    }
    if (!value) value = number(info->second.def());
    if (!value) continue;  // the pipeline names no default to go back to
    const std::optional<double> least = number(info->second.min());
    const std::optional<double> most = number(info->second.max());
    if ((least && *value < *least) || (most && *most > 0 && *value > *most)) {
      entry.note = fmt::format("{} = {} is outside this camera's {} to {}", control.name, *value,
                               least.value_or(0), most.value_or(0));
    } else {
      wishes.list.set(control.id.id(), value_of(control.id.type(), *value));
      entry.value = report_value(control.id, *value);
      entry.verdict = ControlVerdict::accepted;
      entry.note = "set; the frames have not said yet what came of it";
    }
    wishes.controls.push_back(std::move(entry));
  }
  // Not count(): libcamera 0.0.3 counts every control there is, not the camera's.
  if (offered.find(lc::controls::FrameDurationLimits.id()) != offered.end()) {
    const auto us = static_cast<std::int64_t>(std::llround(1e6 / fps_));
    wishes.list.set(lc::controls::FrameDurationLimits, {us, us});
  }
  return wishes;
}

void PhotometricLock::read(const lc::ControlList& metadata, Readings& readings) {
  for (const Control& control : known_controls()) {
    if (!metadata.contains(control.id.id())) continue;
    const auto value = number(metadata.get(control.id.id()));
    if (value) readings[control.id.id()] = report_value(control.id, *value);
  }
}

std::string PhotometricLock::compare(const Readings& readings,
                                     std::vector<CameraControl>& controls) {
  std::string moved;
  for (CameraControl& entry : controls) {
    const Control* control = find(entry.name);
    if (control == nullptr || entry.verdict == ControlVerdict::refused) continue;
    const auto reading = readings.find(control->id.id());
    if (reading == readings.end()) {
      if (entry.verdict == ControlVerdict::accepted)
        entry.note = "set; this camera's frames do not say what came of it";
      continue;
    }
    if (same(reading->second, entry.value)) {
      entry.verdict = ControlVerdict::confirmed;
      entry.note.clear();
    } else {
      moved += fmt::format("{}{} is {} though it was set to {}", moved.empty() ? "" : "; ",
                           entry.name, reading->second, entry.value);
    }
  }
  return moved;
}

}  // namespace dtact::hal::libcamera_backend
