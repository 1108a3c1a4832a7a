#pragma once

#include <bit>
#include <cstdint>

namespace dtact::pipeline {

/// Where the pipeline is between power-on and shutdown.
enum class State : std::uint8_t {
  settling,      ///< Ring and camera on; waiting for the mean grey to stop moving.
  referencing,   ///< Averaging the reference image.
  serving,       ///< Depth flows.
  uncalibrated,  ///< Luma flows; there is no calibration.
  camera_lost    ///< The camera is away; the report says why.
};

/// Health flags: reasons why depth deserves less trust. The values are those of the wire
/// (dtact.proto, Health); every frame carries a set.
enum class Health : std::uint8_t {
  uncalibrated = 0,        ///< No calibration: luma only.
  starting = 1,            ///< Start-up is not through: no reference yet.
  light_unsettled = 2,     ///< A light change is under way; depth is off until the next reference.
  reference_stale = 3,     ///< The reference does not belong to the present light.
  reference_restored = 4,  ///< After a start: the last good reference is used.
  light_mismatch = 5,      ///< The ring shows another light than at calibration.
  camera_mismatch = 6,     ///< Camera, mode, format or controls differ from the calibration's, or a
                           ///< control moved by itself.
  beyond_calibration = 7,  ///< Somewhere the image is darker than the calibrated LUT reaches.
  frames_lost = 8,         ///< The camera lost frames within the last second.
  camera_fault = 9,        ///< Unplugged, stalled, busy, denied; status has the sentence.
  ring_fault = 10,         ///< The ring is away or refused the last write; status has the sentence.
  not_realtime = 11,       ///< The capture thread runs without real-time scheduling.
  // What the picture itself shows (image_watch.hpp).
  light_drifted = 12,    ///< The light is not the reference's, or most of the field is pressed.
  light_banded = 13,     ///< Moving bands in the picture: PWM against the rolling shutter.
  image_saturated = 14,  ///< Too much of the picture is white.
  image_dark = 15,       ///< The picture is too dark to measure in.
  image_noisy = 16,      ///< Pixels are noisier than smoothing makes up for, or many are dead.
  image_repeated = 17,   ///< All or part of the picture is the one before: frozen or torn.
  camera_shifted =
      18,  ///< The gel's marks lie elsewhere than at calibration (camera_shift_detector.hpp).
  camera_slow = 19,        ///< Fewer frames a second than the camera's mode promises.
  exposure_unlocked = 20,  ///< The rest brightens as a part darkens, as if exposure were automatic.
  machine_slow = 21  ///< Frames come faster than this machine processes them; many are skipped.
};
inline constexpr int kHealthCount = 22;

class HealthSet {
 public:
  void set(Health h, bool on = true) noexcept { bits_ = on ? bits_ | bit(h) : bits_ & ~bit(h); }
  void add(const HealthSet& other) noexcept { bits_ |= other.bits_; }
  [[nodiscard]] bool has(Health h) const noexcept { return (bits_ & bit(h)) != 0; }
  [[nodiscard]] bool empty() const noexcept { return bits_ == 0; }
  [[nodiscard]] std::uint32_t bits() const noexcept { return bits_; }
  bool operator==(const HealthSet&) const = default;

 private:
  static constexpr std::uint32_t bit(Health h) noexcept {
    return 1U << static_cast<std::uint32_t>(h);
  }
  std::uint32_t bits_ = 0;
};

}  // namespace dtact::pipeline
