// fit_sim DATA OUT: fits the simulator to the ball presses of the real sensors a and b. DATA holds
// sensor_a and sensor_b; writes OUT/sim/sensor_a.toml, OUT/sim/sensor_b.toml and the plot
// OUT/sim_profiles.svg. Twelve parameters each: nine of the press (depth, thickness, response,
// scattering) by the radial profile, two of the light by the reference image, one of the noise.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <filesystem>

#include "hal/base/atomic_file.hpp"
#include "tests/accuracy/sim/ball_profile.hpp"
#include "tests/accuracy/sim/press_fit.hpp"
#include "tests/accuracy/sim/profile_plot.hpp"

namespace {

using namespace dtact::accuracy;
namespace sim = dtact::hal::sim;

std::string to_toml(const Sensor& sensor, const Fit& fit) {
  const sim::Scene& s = fit.scene;
  return fmt::format(
      R"(# The simulator fitted to the real ball press of {0}: twelve parameters (thickness, depth, the
# seven of [optics], level, vignetting, read_noise). Scale and size are the images', the place is
# the press's measured centroid. Written by
#   fit_sim DATA tests/accuracy
# where DATA holds {0}; the shared parameters are the built-in scene's.
sensor = "{0}"

[camera]
width = {1}
height = {2}
fps = {3:.1f}
mm_per_px = {4:.4f}
read_noise = {5:.3f}

[gel]
thickness_mm = {6:.3f}

[optics]
pressed_slope = {7:.4f}
pressed_curve = {8:.4f}
bulged_slope = {9:.4f}
bulged_curve = {10:.4f}
narrow_mm = {11:.4f}
wide_mm = {12:.4f}
narrow_weight = {13:.4f}

[light]
level = {14:.2f}
vignetting = {15:.4f}

[[press]]
object = "ball"
radius_mm = {16:.1f}
keys = [
  {{ t = 1.0, x = {17:.3f}, y = {18:.3f}, depth = 0.0 }},
  {{ t = 2.0, depth = {19:.4f} }},
]
)",
      sensor.name, s.camera.width, s.camera.height, s.camera.fps, s.camera.mm_per_px,
      s.camera.read_noise, s.gel.thickness_mm, s.optics.pressed_slope, s.optics.pressed_curve,
      s.optics.bulged_slope, s.optics.bulged_curve, s.optics.narrow_mm, s.optics.wide_mm,
      s.optics.narrow_weight, s.light.level, s.light.vignetting, kBallRadius_mm, fit.x_mm, fit.y_mm,
      fit.depth_mm);
}

ProfilePanel fit_and_write(const Sensor& sensor, const std::filesystem::path& data,
                           const std::filesystem::path& out) {
  const BallPress real = read_real(data / sensor.name);
  const auto file = out / "sim" / (sensor.name + ".toml");
  dtact::base::write_file_atomically(file, to_toml(sensor, fit_sensor(sensor, real)));

  const BallPress simulated = simulate(sim::load_scene(file));
  ProfilePanel panel;
  panel.title = sensor.name;
  panel.real = radial_profile(change_of(real), centroid(real), sensor.mm_per_px);
  panel.simulated = radial_profile(change_of(simulated), centroid(simulated), sensor.mm_per_px);
  fmt::print("{}: {:.2f} RMS, zero {:.2f} / {:.2f} mm, ring {:.1f} at {:.2f} / {:.1f} at {:.2f}\n",
             sensor.name, rms_difference(panel.real, panel.simulated), panel.real.zero_mm,
             panel.simulated.zero_mm, panel.real.ring, panel.real.ring_mm, panel.simulated.ring,
             panel.simulated.ring_mm);
  return panel;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: fit_sim DATA OUT   (DATA holds sensor_a and sensor_b)\n");
    return 2;
  }
  try {
    const std::filesystem::path out = argv[2];
    const std::vector<ProfilePanel> panels = {fit_and_write(kSensorA, argv[1], out),
                                              fit_and_write(kSensorB, argv[1], out)};
    dtact::base::write_file_atomically(out / "sim_profiles.svg", profile_svg(panels));
    return 0;
  } catch (const std::exception& problem) {
    fmt::print(stderr, "fit_sim: {}\n", problem.what());
    return 1;
  }
}
