#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "hal/sim/optics.hpp"
#include "tests/accuracy/sim/ball_profile.hpp"

namespace dtact::accuracy {
namespace {

namespace sim = hal::sim;

const std::filesystem::path kData = DTACT_SHARED_DIR "/data";

sim::Scene fitted(const Sensor& sensor) {
  return sim::load_scene(std::filesystem::path(DTACT_SOURCE_DIR) / "tests/accuracy/sim" /
                         (sensor.name + ".toml"));
}

struct Comparison {
  BallPress real;
  BallPress simulated;
  Profile real_profile;
  Profile simulated_profile;
};

Comparison compare(const Sensor& sensor) {
  Comparison c;
  c.real = read_real(kData / sensor.name);
  c.simulated = simulate(fitted(sensor));
  c.real_profile = radial_profile(change_of(c.real), centroid(c.real), sensor.mm_per_px);
  c.simulated_profile =
      radial_profile(change_of(c.simulated), centroid(c.simulated), sensor.mm_per_px);
  fmt::print(
      "{}: {:.2f} grey levels RMS over 0-9 mm; real / simulated: zero {:.2f} / {:.2f} mm, "
      "ring {:.1f} / {:.1f} at {:.2f} / {:.2f} mm\n",
      sensor.name, rms_difference(c.real_profile, c.simulated_profile), c.real_profile.zero_mm,
      c.simulated_profile.zero_mm, c.real_profile.ring, c.simulated_profile.ring,
      c.real_profile.ring_mm, c.simulated_profile.ring_mm);
  return c;
}

TEST(SimAccuracy, ReproducesTheBallPressOfSensorA) {
  if (!std::filesystem::exists(kData / "sensor_a")) {
    GTEST_SKIP() << "the real images of sensor_a are not at " << kData;
  }
  const Comparison c = compare(kSensorA);
  EXPECT_LE(rms_difference(c.real_profile, c.simulated_profile), 1.5);
  EXPECT_NEAR(c.simulated_profile.zero_mm, c.real_profile.zero_mm, 0.1);
  EXPECT_NEAR(c.simulated_profile.ring, c.real_profile.ring, 2);
  EXPECT_NEAR(c.simulated_profile.ring_mm, c.real_profile.ring_mm, 0.3);
}

TEST(SimAccuracy, HasTheNoiseOfSensorA) {
  if (!std::filesystem::exists(kData / "sensor_a")) {
    GTEST_SKIP() << "the real images of sensor_a are not at " << kData;
  }
  // The real images are means of ten frames.
  const double real = high_pass_noise(read_real(kData / "sensor_a").reference);
  const double simulated = high_pass_noise(simulate(fitted(kSensorA)).reference);
  fmt::print("noise of the mean of ten frames: real {:.3f}, simulated {:.3f}\n", real, simulated);
  EXPECT_NEAR(simulated / real, 1, 0.15);
}

// shared/data/README.md: the high-pass noise of one frame of sensor_a is 0.98 grey levels.
TEST(SimAccuracy, OneFrameHasTheNoiseOfOneFrame) {
  const double noise = high_pass_noise(simulate_frame(fitted(kSensorA)));
  fmt::print("noise of one simulated frame: {:.3f}\n", noise);
  EXPECT_NEAR(noise / 0.98, 1, 0.15);
}

TEST(SimAccuracy, ReportsSensorB) {
  if (!std::filesystem::exists(kData / "sensor_b")) {
    GTEST_SKIP() << "the real images of sensor_b are not at " << kData;
  }
  const Comparison c = compare(kSensorB);
  EXPECT_LE(rms_difference(c.real_profile, c.simulated_profile), 1.5);
}

TEST(SimAccuracy, ParametersArePhysical) {
  for (const Sensor& sensor : {kSensorA, kSensorB}) {
    const sim::Scene scene = fitted(sensor);
    EXPECT_GE(scene.optics.narrow_weight, 0) << sensor.name;
    EXPECT_LE(scene.optics.narrow_weight, 1) << sensor.name;
    EXPECT_GT(scene.optics.narrow_mm, 0) << sensor.name;
    EXPECT_LT(scene.optics.narrow_mm, scene.optics.wide_mm) << sensor.name;
    // physics.md: gels are 1 to 3 mm thick.
    EXPECT_GE(scene.gel.thickness_mm, 1) << sensor.name;
    EXPECT_LE(scene.gel.thickness_mm, 3) << sensor.name;
    double last = -1;
    const int deepest_um = static_cast<int>(900 * scene.gel.thickness_mm);
    for (int um = -static_cast<int>(200 * scene.gel.thickness_mm); um < deepest_um; um += 10) {
      const double d = um / 1000.0;
      const double now = sim::response(scene.optics, d);
      ASSERT_GT(now, last) << sensor.name << " at " << d << " mm";
      last = now;
    }
  }
}

TEST(SimAccuracy, BuiltInSceneHasTheResponseOfSensorA) {
  const sim::OpticsModel built_in = sim::default_scene().optics;
  const sim::OpticsModel a = fitted(kSensorA).optics;
  EXPECT_EQ(built_in.pressed_slope, a.pressed_slope);
  EXPECT_EQ(built_in.pressed_curve, a.pressed_curve);
  EXPECT_EQ(built_in.bulged_slope, a.bulged_slope);
  EXPECT_EQ(built_in.bulged_curve, a.bulged_curve);
  EXPECT_EQ(built_in.narrow_mm, a.narrow_mm);
  EXPECT_EQ(built_in.wide_mm, a.wide_mm);
  EXPECT_EQ(built_in.narrow_weight, a.narrow_weight);
}

}  // namespace
}  // namespace dtact::accuracy
