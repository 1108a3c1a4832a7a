#pragma once

#include <string>

namespace dtact::hal::live {

/// The exposure that is asked for, in microseconds: `us` itself, or a whole number of periods of
/// the LEDs' PWM, under which a rolling shutter sees no bands. 0 = the camera's default. Throws
/// std::runtime_error naming the keys of `section` when they contradict or are impossible.
[[nodiscard]] double exposure_us(const std::string& section, double us, int pwm_periods,
                                 double pwm_hz);

/// The note on a camera that has only `got_us` for `asked_us`; empty when they differ by less than
/// a hundredth. Exposure that misses whole PWM periods by a hundredth leaves bands of that depth.
[[nodiscard]] std::string rounding_note(double asked_us, double got_us);

}  // namespace dtact::hal::live
