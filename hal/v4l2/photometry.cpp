#include "hal/v4l2/photometry.hpp"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <optional>
#include <stdexcept>

#include "hal/live/exposure.hpp"
#include "hal/v4l2/node.hpp"

namespace dtact::hal::v4l2 {
namespace {

namespace fs = std::filesystem;

struct Control {
  const char* name;
  std::uint32_t id;
  std::optional<std::int64_t> off;     ///< The value that keeps it from acting by itself.
  const char* when_refused = nullptr;  ///< What may follow, where its name doesn't say it.
};

constexpr const char* kAutoExposure = "auto_exposure";
constexpr const char* kExposure = "exposure_time_absolute";
constexpr const char* kGain = "gain";
/// V4L2_CID_EXPOSURE_ABSOLUTE counts in 100 µs.
constexpr double kExposureUnitUs = 100;

/// In the order of setting: many cameras refuse a value while its automatic is on. uvcvideo's
/// answer about a value reads its automatic, which must have been set by then (see LockedControl).
constexpr std::array<Control, 17> kControls{{
    {kAutoExposure, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL},
    {"exposure_dynamic_framerate", V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0,
     "in the dark the camera may halve its frame rate"},
    {"gain_automatic", V4L2_CID_AUTOGAIN, 0},
    {"white_balance_automatic", V4L2_CID_AUTO_WHITE_BALANCE, 0},
    {"focus_automatic_continuous", V4L2_CID_FOCUS_AUTO, 0},
    {"power_line_frequency", V4L2_CID_POWER_LINE_FREQUENCY, V4L2_CID_POWER_LINE_FREQUENCY_DISABLED,
     "the camera may keep its exposure to the mains, and the LEDs then show as bands"},
    {"backlight_compensation", V4L2_CID_BACKLIGHT_COMPENSATION, 0},
    {kExposure, V4L2_CID_EXPOSURE_ABSOLUTE, std::nullopt},
    {kGain, V4L2_CID_GAIN, std::nullopt},
    {"white_balance_temperature", V4L2_CID_WHITE_BALANCE_TEMPERATURE, std::nullopt},
    {"focus_absolute", V4L2_CID_FOCUS_ABSOLUTE, std::nullopt},
    {"gamma", V4L2_CID_GAMMA, std::nullopt},
    {"contrast", V4L2_CID_CONTRAST, std::nullopt},
    {"brightness", V4L2_CID_BRIGHTNESS, std::nullopt},
    {"saturation", V4L2_CID_SATURATION, std::nullopt},
    {"hue", V4L2_CID_HUE, std::nullopt},
    {"sharpness", V4L2_CID_SHARPNESS, std::nullopt},
}};

const Control* find(const std::string& name) {
  const auto* it = std::ranges::find_if(kControls, [&](const auto& c) { return name == c.name; });
  return it == kControls.end() ? nullptr : it;
}

std::optional<v4l2_queryctrl> query(int fd, std::uint32_t id) {
  v4l2_queryctrl q{};
  q.id = id;
  if (call(fd, VIDIOC_QUERYCTRL, q) != 0 || (q.flags & V4L2_CTRL_FLAG_DISABLED) != 0) {
    return std::nullopt;
  }
  return q;
}

int get(int fd, std::uint32_t id, std::int64_t& value) {
  v4l2_control control{id, 0};
  const int error = call(fd, VIDIOC_G_CTRL, control);
  if (error == 0) value = control.value;
  return error;
}

int set(int fd, std::uint32_t id, std::int64_t value) {
  v4l2_control control{id, static_cast<std::int32_t>(value)};
  return call(fd, VIDIOC_S_CTRL, control);
}

/// Reads a control. `asked`: it took a transfer, so the answer is the camera's own.
int get_counted(int fd, std::uint32_t id, const fs::path& usb_device, std::int64_t& value,
                bool& asked) {
  const auto before = transfers_of(usb_device);
  const int error = get(fd, id, value);
  asked = error == 0 && before && transfers_of(usb_device) != before;
  return error;
}

/// The value nearest to `value` that the control has. The kernel rounds in the same way and without
/// an error, so another value would be refused when it is read back. lock() refuses values outside
/// the range.
std::int64_t nearest(const v4l2_queryctrl& offered, std::int64_t value) {
  if (value < offered.minimum || value > offered.maximum) return value;
  const std::int64_t step = std::max<std::int64_t>(1, offered.step);
  const std::int64_t steps = (value - offered.minimum + step / 2) / step;
  const std::int64_t rounded = offered.minimum + steps * step;
  return rounded > offered.maximum ? rounded - step : rounded;
}

/// Sets one control and reads it back.
LockedControl lock(int fd, const Control& control, const v4l2_queryctrl& offered,
                   std::int64_t value, const fs::path& usb_device) {
  LockedControl locked;
  CameraControl& result = locked.control;
  result.name = control.name;
  if (value < offered.minimum || value > offered.maximum) {
    (void)get(fd, control.id, result.value);
    result.note = fmt::format("{} = {} is outside this camera's {} to {}", control.name, value,
                              offered.minimum, offered.maximum);
    return locked;
  }
  int error = set(fd, control.id, value);
  if (error != 0 && control.id == V4L2_CID_EXPOSURE_AUTO) {
    // Manual time with an automatic iris, which this kind of camera doesn't have.
    value = V4L2_EXPOSURE_SHUTTER_PRIORITY;
    error = set(fd, control.id, value);
  }
  if (error != 0) {
    (void)get(fd, control.id, result.value);
    result.note =
        fmt::format("the camera refuses {} = {} ({})", control.name, value, std::strerror(error));
    return locked;
  }
  error = get_counted(fd, control.id, usb_device, result.value, locked.asked);
  if (error != 0) {
    result.note = fmt::format("{} cannot be read back ({})", control.name, std::strerror(error));
    return locked;
  }
  if (locked.asked) {
    std::int64_t same = 0;
    (void)get_counted(fd, control.id, usb_device, same, locked.always_asked);
  }
  // The control framework asks the driver for volatile ones, and answers itself for the rest.
  if ((offered.flags & V4L2_CTRL_FLAG_VOLATILE) != 0) locked.asked = locked.always_asked = true;
  if (result.value != value) {
    result.note = fmt::format("{} is {} after it was set to {}", control.name, result.value, value);
    return locked;
  }
  result.verdict = locked.asked ? ControlVerdict::confirmed : ControlVerdict::accepted;
  return locked;
}

}  // namespace

std::vector<OfferedControl> list_controls(int fd) {
  std::vector<OfferedControl> offered;
  for (const Control& control : kControls) {
    const auto q = query(fd, control.id);
    if (!q) continue;
    OfferedControl entry{control.name, q->minimum, q->maximum, q->step, q->default_value, 0};
    (void)get(fd, control.id, entry.value);
    offered.push_back(std::move(entry));
  }
  return offered;
}

PhotometricLock::PhotometricLock(const V4l2Config& config)
    : config_(config),
      exposure_us_(live::exposure_us("camera.v4l2", config.exposure_us, config.exposure_pwm_periods,
                                     config.pwm_hz)) {
  for (const auto& [name, value] : config.controls) {
    if (find(name) == nullptr) {
      std::string names;
      for (const Control& c : kControls)
        names += fmt::format("{}{}", names.empty() ? "" : ", ", c.name);
      throw std::runtime_error(fmt::format(
          "camera.v4l2.controls.{}: not a control of the lock; allowed are {}", name, names));
    }
  }
  if (exposure_us_ > 0 && config.controls.contains(kExposure)) {
    throw std::runtime_error(
        "camera.v4l2: give the exposure by exposure_us, by exposure_pwm_periods or by "
        "controls.exposure_time_absolute, not by several");
  }
}

std::vector<LockedControl> PhotometricLock::apply(int fd, const fs::path& usb_device) const {
  std::vector<LockedControl> controls;
  for (const Control& control : kControls) {
    const auto configured = config_.controls.find(control.name);
    const bool exposure = control.name == std::string(kExposure) && exposure_us_ > 0;
    const auto offered = query(fd, control.id);
    if (!offered) {
      if (exposure || configured != config_.controls.end()) {
        LockedControl missing;
        missing.control.name = control.name;
        missing.control.note = fmt::format("this camera has no {}", control.name);
        controls.push_back(std::move(missing));
      }
      continue;
    }
    std::int64_t value = control.off.value_or(offered->default_value);
    if (configured != config_.controls.end()) value = configured->second;
    if (exposure) {
      value = nearest(*offered,
                      std::max<std::int64_t>(1, std::llround(exposure_us_ / kExposureUnitUs)));
    }
    controls.push_back(lock(fd, control, *offered, value, usb_device));
    CameraControl& result = controls.back().control;
    if (result.verdict == ControlVerdict::refused) {
      if (control.when_refused != nullptr) result.note += fmt::format(": {}", control.when_refused);
    } else if (exposure) {
      result.note = live::rounding_note(exposure_us_, static_cast<double>(value) * kExposureUnitUs);
    }
  }
  return controls;
}

std::vector<CameraControl> PhotometricLock::apply_again(
    int fd, const std::vector<LockedControl>& before) const {
  std::vector<CameraControl> controls;
  // A stream's transfers hide those of a question, so none are counted.
  for (LockedControl& locked : apply(fd, {})) {
    CameraControl& now = locked.control;
    const auto then =
        std::ranges::find(before, now.name, [](const LockedControl& l) { return l.control.name; });
    if (now.verdict == ControlVerdict::accepted && then != before.end()) {
      if (then->always_asked) {
        now.verdict = ControlVerdict::confirmed;
      } else if (then->asked) {
        now = then->control;
      }
    }
    controls.push_back(std::move(now));
  }
  return controls;
}

std::string PhotometricLock::check(int fd, std::vector<CameraControl>& controls) const {
  std::string moved;
  for (CameraControl& control : controls) {
    const Control* known = find(control.name);
    if (control.verdict == ControlVerdict::refused || known == nullptr) continue;
    std::int64_t value = control.value;
    if (get(fd, known->id, value) != 0 || value == control.value) continue;
    moved += fmt::format("{}{} moved from {} to {} by itself", moved.empty() ? "" : "; ",
                         control.name, control.value, value);
    (void)set(fd, known->id, control.value);
  }
  if (!moved.empty()) {
    moved += ": it was set back; another program or the camera's own automatic is at work";
  }
  return moved;
}

CameraSettings PhotometricLock::settings(int fd, const std::vector<CameraControl>& controls) {
  const auto setting = [&](const char* name, double unit) -> std::optional<CameraSetting> {
    const auto offered = query(fd, find(name)->id);
    const auto now = std::ranges::find(controls, name, &CameraControl::name);
    if (!offered || now == controls.end()) return std::nullopt;
    return CameraSetting{static_cast<double>(now->value) * unit, offered->minimum * unit,
                         offered->maximum * unit};
  };
  return {setting(kExposure, kExposureUnitUs), setting(kGain, 1)};
}

void PhotometricLock::change(int fd, const CameraChange& change,
                             std::vector<CameraControl>& controls) {
  const std::vector<CameraControl> before = controls;
  const auto set_one = [&](const char* name, const std::optional<double>& value, double unit) {
    if (!value) return;
    const auto now = std::ranges::find(controls, name, &CameraControl::name);
    const auto offered = query(fd, find(name)->id);
    if (!offered || now == controls.end()) {
      throw std::runtime_error(fmt::format("this camera has no {}", name));
    }
    // Not the count of transfers, among which are the stream's.
    const std::int64_t asked = nearest(*offered, std::llround(*value / unit));
    CameraControl set = lock(fd, *find(name), *offered, asked, {}).control;
    if (set.verdict == ControlVerdict::refused) throw std::runtime_error(set.note);
    *now = std::move(set);
  };
  const auto set_back = [&](const char* name, const std::optional<double>& value) {
    const auto then = std::ranges::find(before, name, &CameraControl::name);
    if (value && then != before.end()) (void)set(fd, find(name)->id, then->value);
  };
  try {
    set_one(kExposure, change.exposure_us, kExposureUnitUs);
    set_one(kGain, change.gain, 1);
  } catch (const std::runtime_error&) {
    // The caller reports what was before. A control left at another value would be set back later
    // by check(), as one that moved by itself.
    controls = before;
    set_back(kExposure, change.exposure_us);
    set_back(kGain, change.gain);
    throw;
  }
}

}  // namespace dtact::hal::v4l2
