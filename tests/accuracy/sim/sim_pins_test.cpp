#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "tests/accuracy/sim/pin_profile.hpp"
#include "tests/accuracy/table/another_law.hpp"

namespace dtact::accuracy {
namespace {

const std::filesystem::path kData = DTACT_SHARED_DIR "/data";
const std::filesystem::path kHere = DTACT_SOURCE_DIR "/tests/accuracy/sim";

// The middle pin's place in shared/data/README.md.
constexpr Centre kMiddleOfA = {327, 240};
constexpr Centre kMiddleOfC = {324, 244};

void report(const char* what, const PinProfile& simulated, const PinProfile& real, double offset) {
  fmt::print(
      "{}: {:.2f} grey levels RMS; real / simulated: at a pin {:.1f} / {:.1f}, half-way {:.1f} / "
      "{:.1f}, in the middle of four {:.1f} / {:.1f}\n",
      what, rms_difference(simulated, real, offset), real.change.front(),
      simulated.change.front() + offset, real.between, simulated.between + offset, real.diagonal,
      simulated.diagonal + offset);
}

// sensor_a.toml was fitted to one press of a ball, not to objects 0.6 mm wide and 2.5 mm apart;
// only the depth of the pins is fitted here.
TEST(SimPins, TheBallOfSensorAPredictsItsPins) {
  if (!std::filesystem::exists(kData / "sensor_a")) {
    GTEST_SKIP() << "the real images of sensor_a are not at " << kData;
  }
  const PinProfile real = real_pins(kData / "sensor_a", kMiddleOfA);
  const PinProfile simulated = simulated_pins(hal::sim::load_scene(kHere / "sensor_a.toml"), 0.76);
  report("sensor_a", simulated, real, 0);
  EXPECT_LE(rms_difference(simulated, real, 0), 1.5);
}

// The other law fits sensor_a as well.
TEST(SimPins, AnotherLawShowsThePinsOfSensorA) {
  if (!std::filesystem::exists(kData / "sensor_a")) {
    GTEST_SKIP() << "the real images of sensor_a are not at " << kData;
  }
  const PinProfile real = real_pins(kData / "sensor_a", kMiddleOfA);
  const PinProfile simulated = simulated_pins(table::another_law(), 0.55);
  report("another law", simulated, real, -2);
  EXPECT_LE(rms_difference(simulated, real, -2), 1.5);
}

// sensor_c scatters farther: no depth of sensor_a's pins looks like its own.
TEST(SimPins, SensorCScattersFarther) {
  if (!std::filesystem::exists(kData / "sensor_c")) {
    GTEST_SKIP() << "the real images of sensor_c are not at " << kData;
  }
  const PinProfile real = real_pins(kData / "sensor_c", kMiddleOfC);
  const PinProfile own = simulated_pins(hal::sim::load_scene(kHere / "sensor_c.toml"), 1.09);
  report("sensor_c", own, real, 0.3);
  EXPECT_LE(rms_difference(own, real, 0.3), 0.8);
  const hal::sim::Scene a = hal::sim::load_scene(kHere / "sensor_a.toml");
  for (const double depth : {0.5, 0.6, 0.7}) {
    const PinProfile of_a = simulated_pins(a, depth);
    report("sensor_c by sensor_a's scattering", of_a, real, 0);
    EXPECT_GE(rms_difference(of_a, real, 0), 1.5) << depth;
  }
}

}  // namespace
}  // namespace dtact::accuracy
