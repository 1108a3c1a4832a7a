#include "hal/live/exposure.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace dtact::hal::live {

double exposure_us(const std::string& section, double us, int pwm_periods, double pwm_hz) {
  if (!(us >= 0)) {
    throw std::runtime_error(
        fmt::format("{}.exposure_us must be positive, or 0 for the camera's default", section));
  }
  if (pwm_periods < 0) {
    throw std::runtime_error(
        fmt::format("{}.exposure_pwm_periods must be positive, or 0", section));
  }
  if (pwm_periods == 0) return us;
  if (us > 0) {
    throw std::runtime_error(
        fmt::format("{}: give exposure_us or exposure_pwm_periods, not both", section));
  }
  if (!(pwm_hz > 0)) {
    throw std::runtime_error(fmt::format(
        "{0}.exposure_pwm_periods needs {0}.pwm_hz, the LEDs' PWM frequency (about 430 Hz for old "
        "WS2812B, 2000 Hz for new ones)",
        section));
  }
  return pwm_periods * 1e6 / pwm_hz;
}

std::string rounding_note(double asked_us, double got_us) {
  if (std::abs(got_us - asked_us) <= 0.01 * asked_us) return {};
  return fmt::format("{:.0f} us is the nearest this camera has to {:.1f} us", got_us, asked_us);
}

}  // namespace dtact::hal::live
