#include "tests/accuracy/table/configuration.hpp"

#include <array>
#include <cmath>
#include <cstdint>

#include "daemon/net/light_schemes.hpp"
#include "hal/sim/light_field.hpp"

namespace dtact::table {
namespace {

using hal::sim::Arrangement;

constexpr std::array<Configuration, 6> kConfigurations = {{
    {"all LEDs", "all", Arrangement::ring, 1, {}, Published{4.080, 0.0476, 0.0534}},
    {"scheme 1", "scheme1", Arrangement::ring, 2, {}, Published{5.237, 0.0509, 0.0542}},
    {"scheme 2", "scheme2", Arrangement::ring, 2, {}, Published{5.262, 0.0524, 0.0586}},
    {"scheme 3", "scheme3", Arrangement::ring, 2, {}, Published{5.451, 0.0650, 0.0678}},
    {"scheme 4", "scheme4", Arrangement::ring, 2, {12, -12}, Published{16.550, 0.0510, 0.0651}},
    {"side-lit", "all", Arrangement::sides, 1, {}, std::nullopt},
}};

}  // namespace

calibration::CameraView view_of(const hal::sim::Scene& scene) {
  const double mm = scene.surface.camera_mm;
  if (mm == 0) return {};
  return {.foot_mm = {}, .source = calibration::HeightSource::drawing, .per_mm = 1 / mm};
}

std::span<const Configuration> configurations() { return kConfigurations; }

hal::sim::Scene lit(hal::sim::Scene base, const Configuration& configuration) {
  base.light.arrangement = configuration.arrangement;
  base.camera.exposure = configuration.exposure;
  return base;
}

hal::Light light_of(const Configuration& configuration) {
  return {net::scheme_leds(configuration.scheme).value(), 255};
}

double reference_deviation(const Configuration& configuration) {
  const hal::sim::Scene scene = lit(hal::sim::default_scene(), configuration);
  std::vector<std::uint16_t> plane(std::size_t{kFrameWidth} * kFrameHeight);
  hal::sim::LightField(scene).compute(hal::sim::led_levels(light_of(configuration)), plane);
  double sum = 0;
  double squares = 0;
  for (int y = kCropRow; y < kCropRow + kCrop; ++y) {
    for (int x = kCropCol; x < kCropCol + kCrop; ++x) {
      const double grey =
          plane[static_cast<std::size_t>(y) * kFrameWidth + static_cast<std::size_t>(x)] / 64.0;
      sum += grey;
      squares += grey * grey;
    }
  }
  const double n = double{kCrop} * kCrop;
  return std::sqrt(squares / n - sum / n * (sum / n));
}

}  // namespace dtact::table
