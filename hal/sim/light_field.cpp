#include "hal/sim/light_field.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "hal/sim/grid.hpp"

namespace dtact::hal::sim {
namespace {

// An even random number of unit variance for a lattice point: MurmurHash3's finaliser (Appleby).
double node(std::int64_t column, std::int64_t row) {
  auto x = (static_cast<std::uint64_t>(row) << 32U) ^ static_cast<std::uint32_t>(column);
  x = (x ^ (x >> 33U)) * 0xFF51AFD7ED558CCDU;
  x = (x ^ (x >> 33U)) * 0xC4CEB9FE1A85EC53U;
  x ^= x >> 33U;
  const double unit = static_cast<double>(x >> 11U) * 0x1.0p-53;
  return (2 * unit - 1) * std::sqrt(3.0);
}

std::array<double, 4> spline(double f) {
  const double g = 1 - f;
  return {g * g * g / 6, (3 * f * f * f - 6 * f * f + 4) / 6, (3 * g * g * g - 6 * g * g + 4) / 6,
          f * f * f / 6};
}

// What the weights leave of the nodes' variance along one axis, averaged over a cell: the cubic
// B-spline's square has the integral 151/315.
constexpr double kLeft = 151.0 / 315.0;

}  // namespace

Texture::Texture(double rms, double size_mm) noexcept : scale_(rms / kLeft), size_mm_(size_mm) {}

double Texture::at(const Place& place) const noexcept {
  if (scale_ == 0) return 0;
  const double u = place.x_mm / size_mm_;
  const double v = place.y_mm / size_mm_;
  const auto left = static_cast<std::int64_t>(std::floor(u));
  const auto top = static_cast<std::int64_t>(std::floor(v));
  const auto across = spline(u - static_cast<double>(left));
  const auto down = spline(v - static_cast<double>(top));
  double sum = 0;
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      sum += down[static_cast<std::size_t>(j)] * across[static_cast<std::size_t>(i)] *
             node(left + i, top + j);
    }
  }
  return scale_ * sum;
}

namespace {

std::array<Place, kLedCount> led_places(const LightModel& light) {
  std::array<Place, kLedCount> places;
  for (int i = 0; i < kLedCount; ++i) {
    Place& place = places[static_cast<std::size_t>(i)];
    if (light.arrangement == Arrangement::ring) {
      const double angle = 2 * std::numbers::pi * i / kLedCount;
      place = {light.led_radius_mm * std::cos(angle), light.led_radius_mm * std::sin(angle)};
    } else {
      const double along = (i % 4 - 1.5) / 2 * light.led_radius_mm;
      place = {i < 4 ? light.led_radius_mm : -light.led_radius_mm, along};
    }
  }
  return places;
}

// One LED's direct light at a place of the gel, relative to that at its foot.
double direct(const Place& led, const Place& at, double distance_mm) {
  const double dx = (at.x_mm - led.x_mm) / distance_mm;
  const double dy = (at.y_mm - led.y_mm) / distance_mm;
  const double fall = 1 + dx * dx + dy * dy;
  return 1 / (fall * fall);
}

}  // namespace

LedLevels led_levels(const Light& light) noexcept {
  LedLevels levels{};
  for (std::size_t i = 0; i < levels.size(); ++i) {
    const Rgb& led = light.leds[i];
    // Luma of linear light, ITU-R BT.601's weights.
    const int luma = (299 * led.r + 587 * led.g + 114 * led.b + 500) / 1000;
    levels[i] = static_cast<std::uint16_t>(luma * light.brightness);
  }
  return levels;
}

LedLevels mean(const LedLevels& a, const LedLevels& b) noexcept {
  LedLevels half{};
  for (std::size_t i = 0; i < half.size(); ++i) {
    half[i] = static_cast<std::uint16_t>((a[i] + b[i]) / 2);
  }
  return half;
}

LightField::LightField(const Scene& scene)
    : pixels_(static_cast<std::size_t>(scene.camera.width) *
              static_cast<std::size_t>(scene.camera.height)),
      shares_(kLedCount * pixels_) {
  const CameraModel& camera = scene.camera;
  const LightModel& light = scene.light;
  const auto leds = led_places(light);
  const Texture texture(scene.gel.texture, scene.gel.texture_mm);
  double at_centre = 0;
  for (const Place& led : leds) at_centre += direct(led, {}, light.led_distance_mm);

  // Q10 grey; 65536 / 65025 makes up for compute()'s shift instead of a division.
  const double full = light.level * camera.exposure * 1024 * 65536 / 65025;
  for (int row = 0; row < camera.height; ++row) {
    for (int column = 0; column < camera.width; ++column) {
      const Place at = pixel_place(camera, column, row);
      const double dx = 2.0 * column / (camera.width - 1) - 1;
      const double dy = 2.0 * row / (camera.height - 1) - 1;
      const double w = camera.width;
      const double h = camera.height;
      const double radius2 = (dx * dx * w * w + dy * dy * h * h) / (w * w + h * h);
      const double kept = (1 - light.vignetting * radius2) * (1 + texture.at(at));
      const std::size_t pixel =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(camera.width) +
          static_cast<std::size_t>(column);
      for (std::size_t i = 0; i < leds.size(); ++i) {
        const double share =
            light.fill / kLedCount +
            (1 - light.fill) * direct(leds[i], at, light.led_distance_mm) / at_centre;
        shares_[i * pixels_ + pixel] =
            static_cast<std::uint16_t>(std::min(std::lround(full * share * kept), 65535L));
      }
    }
  }
}

void LightField::compute(const LedLevels& levels, std::span<std::uint16_t> out) const noexcept {
  constexpr std::size_t kStrip = 4096;  // sums that stay in the first-level cache
  std::array<std::uint32_t, kStrip> sums;
  for (std::size_t begin = 0; begin < pixels_; begin += kStrip) {
    const std::size_t n = std::min(kStrip, pixels_ - begin);
    sums.fill(0);
    for (std::size_t led = 0; led < levels.size(); ++led) {
      const std::uint32_t level = levels[led];
      const std::uint16_t* const share = shares_.data() + led * pixels_ + begin;
      // Eight products of 32 bits, each without its low byte, fit 32 bits.
      for (std::size_t i = 0; i < n; ++i) sums[i] += (share[i] * level) >> 8U;
    }
    for (std::size_t i = 0; i < n; ++i) {
      out[begin + i] = static_cast<std::uint16_t>(
          std::min<std::uint32_t>((sums[i] + (1U << 11U)) >> 12U, 65535));
    }
  }
}

}  // namespace dtact::hal::sim
