#include "hal/sim/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <stdexcept>

#include "hal/base/atomic_file.hpp"
#include "hal/files/key_reader.hpp"
#include "hal/sim/calibrated.hpp"
#include "hal/sim/default_scene.hpp"

namespace dtact::hal::sim {
namespace {

using tomlfile::KeyReader;

// A rigid object deeper than this would have to squeeze the gel to nothing, where a linear law
// no longer holds.
constexpr double kDeepest = 0.9;  // of the gel's thickness

// About either axis. The lowest point of an object that is tilted farther may lie on its upper
// side.
constexpr double kMaxTilt = 60;  // degrees

const std::vector<std::string> kObjects = {
    "ball",        "ball_array", "disc",       "cube",        "cylinder",
    "grating",     "pin_board",  "m4_nut",     "m3_long_nut", "m5_hexagon_screw",
    "star",        "screw_cap",  "usb_c_plug", "key",         "three_set_screws",
    "two_pillars", "height_map"};

Object read_object(KeyReader& press, const std::filesystem::path& folder) {
  press.require("object");
  int index = 0;
  press.choice_if("object", index, kObjects);
  const std::string& kind = kObjects[static_cast<std::size_t>(index)];
  const auto length = [&](const char* key, double lowest, double highest) {
    return press.number(key, lowest, highest);
  };
  const auto count = [&](const char* key) { return static_cast<int>(press.integer(key, 1, 50)); };
  if (kind == "ball") return ball(length("radius_mm", 0.2, 50));
  if (kind == "ball_array") {
    const double radius = length("radius_mm", 0.2, 10);
    const double pitch = length("pitch_mm", 0.5, 20);
    const int rows = count("rows");
    return ball_array(radius, pitch, rows, count("columns"));
  }
  if (kind == "disc") return disc(length("radius_mm", 0.2, 11));
  if (kind == "two_pillars") {
    const double radius = length("radius_mm", 0.2, 5);
    return two_pillars(radius, length("spacing_mm", 0.4, 20));
  }
  if (kind == "cube") return cube(length("side_mm", 0.5, 20));
  if (kind == "cylinder") {
    const double radius = length("radius_mm", 0.2, 50);
    return cylinder(radius, length("length_mm", 0.5, 40));
  }
  if (kind == "grating") {
    const double pitch = length("pitch_mm", 0.3, 10);
    const double depth = length("groove_mm", 0.05, 5);
    return grating(pitch, depth, length("side_mm", 1, 20));
  }
  if (kind == "pin_board") return pin_board();
  if (kind == "m4_nut") return m4_nut();
  if (kind == "m3_long_nut") return m3_long_nut();
  if (kind == "m5_hexagon_screw") return m5_hexagon_screw();
  if (kind == "three_set_screws") return three_set_screws();
  if (kind == "star") return star(length("radius_mm", 1, 10));
  if (kind == "screw_cap") return screw_cap();
  if (kind == "usb_c_plug") return usb_c_plug();
  if (kind == "key") return key();
  press.require("image");
  std::string image;
  press.text_if("image", image);
  const double mm_per_px = length("mm_per_px", 0.001, 1);
  const double relief = length("relief_mm", 0.01, 20);
  try {
    return height_map(folder / image, mm_per_px, relief);
  } catch (const std::exception& problem) {
    press.fail("image", problem.what());
  }
}

Press read_press(KeyReader& table, const std::filesystem::path& folder, double thickness_mm) {
  Press press;
  press.object = read_object(table, folder);
  table.require("keys");
  PressKey key;  // what a key leaves out is as in the one before
  for (KeyReader& entry : table.tables("keys")) {
    entry.require("t");
    const double last = key.time_s;
    entry.number_if("t", key.time_s, 0, 1e5);
    if (!press.keys.empty() && key.time_s <= last) {
      entry.fail("t", "must be later than in the key before");
    }
    entry.number_if("x", key.x_mm, -100, 100);
    entry.number_if("y", key.y_mm, -100, 100);
    entry.number_if("depth", key.depth_mm, -10, kDeepest * thickness_mm);
    entry.number_if("rotation", key.rotation_deg, -3600, 3600);
    entry.number_if("tilt_x", key.tilt_x_deg, -kMaxTilt, kMaxTilt);
    entry.number_if("tilt_y", key.tilt_y_deg, -kMaxTilt, kMaxTilt);
    entry.number_if("drag_x", key.drag_x_mm, -thickness_mm, thickness_mm);
    entry.number_if("drag_y", key.drag_y_mm, -thickness_mm, thickness_mm);
    entry.finish();
    press.keys.push_back(key);
  }
  if (press.keys.empty()) table.fail("keys", "must hold at least one key");
  if (press.keys.front().time_s > 0 && press.keys.front().depth_mm > 0) {
    table.fail("keys", "must begin at the surface (depth 0 or less), or at t = 0");
  }
  table.finish();
  return press;
}

Fault read_fault(KeyReader& table) {
  static const std::vector<std::string> kKinds = {
      "drop", "repeat", "torn", "truncate", "stall", "unplug", "hang", "auto_exposure", "covered"};
  Fault fault;
  table.require("kind");
  table.require("frame");
  int kind = 0;
  table.choice_if("kind", kind, kKinds);
  fault.kind = static_cast<FaultKind>(kind);
  std::int64_t frame = 0;
  std::int64_t frames = 1;
  table.integer_if("frame", frame, 0, std::int64_t{1} << 40);
  table.integer_if("frames", frames, 1, 1'000'000);
  fault.frame = static_cast<std::uint64_t>(frame);
  fault.frames = static_cast<std::uint64_t>(frames);
  table.finish();
  return fault;
}

void read_camera(KeyReader table, CameraModel& camera) {
  table.integer_if("width", camera.width, 64, 4096);
  table.integer_if("height", camera.height, 64, 4096);
  table.number_if("fps", camera.fps, 1, 240);
  table.number_if("mm_per_px", camera.mm_per_px, 0.005, 0.5);
  table.number_if("barrel", camera.barrel, 0, 0.5);
  table.number_if("exposure", camera.exposure, 0.05, 4);
  table.number_if("gamma", camera.gamma, 0.5, 3);
  table.number_if("read_noise", camera.read_noise, 0, 3);
  table.number_if("shot_noise", camera.shot_noise, 0, 3);
  table.integer_if("light_delay_frames", camera.light_delay_frames, 2, 8);
  table.finish();
}

// The response as slopes between knots, where the file has it.
void read_response(KeyReader& table, OpticsModel& optics) {
  if (!table.has("knots") && !table.has("slopes")) return;
  optics.knots = table.numbers("knots", -1, 1);
  optics.slopes = table.numbers("slopes", 0.001, 20);
  if (optics.knots.size() < 2 ||
      std::ranges::adjacent_find(optics.knots, std::greater_equal()) != optics.knots.end()) {
    table.fail("knots", "must be two or more, ascending");
  }
  if (optics.slopes.size() != optics.knots.size()) {
    table.fail("slopes", fmt::format("must be as many as knots: {}", optics.knots.size()));
  }
}

// A response that turns back would give two indentations the same grey. The bulge stays below a
// fifth of the thickness even for the deepest press.
void check_curves(KeyReader& table, const OpticsModel& optics, double thickness_mm) {
  if (optics.pressed_slope + 2 * optics.pressed_curve * kDeepest * thickness_mm <= 0) {
    table.fail("pressed_curve", "makes the response fall before the deepest indentation allowed");
  }
  if (optics.bulged_slope - 2 * optics.bulged_curve * 0.2 * thickness_mm <= 0) {
    table.fail("bulged_curve", "makes the response fall before the highest bulge");
  }
}

void read_optics(KeyReader table, OpticsModel& optics, double thickness_mm) {
  table.number_if("pressed_slope", optics.pressed_slope, 0.001, 2);
  table.number_if("pressed_curve", optics.pressed_curve, -1, 1);
  table.number_if("bulged_slope", optics.bulged_slope, 0.001, 4);
  table.number_if("bulged_curve", optics.bulged_curve, -4, 4);
  table.number_if("narrow_mm", optics.narrow_mm, 0, 3);
  table.number_if("wide_mm", optics.wide_mm, 0, 6);
  table.number_if("narrow_weight", optics.narrow_weight, 0, 1);
  table.number_if("far_mm", optics.far_mm, 0, 12);
  table.number_if("far_weight", optics.far_weight, 0, 1);
  table.number_if("growth", optics.growth, 0, 1);
  if (optics.narrow_weight + optics.far_weight > 1) {
    table.fail("far_weight", "must leave narrow_weight its share: together at most 1");
  }
  read_response(table, optics);
  if (optics.knots.empty()) check_curves(table, optics, thickness_mm);
  table.finish();
}

void read_surface(KeyReader table, SurfaceModel& surface) {
  int shape = static_cast<int>(surface.shape);
  table.choice_if("shape", shape, {"plane", "sphere", "cylinder"});
  surface.shape = static_cast<SurfaceShape>(shape);
  if (surface.shape != SurfaceShape::plane) {
    table.require("radius_mm");
    table.require("camera_mm");
    surface.radius_mm = table.number("radius_mm", 5, 500);
    surface.camera_mm = table.number("camera_mm", 1, surface.radius_mm);
  } else {
    table.number_if("camera_mm", surface.camera_mm, 0, 1000);
  }
  table.finish();
}

void read_light(KeyReader table, LightModel& light) {
  int arrangement = static_cast<int>(light.arrangement);
  table.choice_if("arrangement", arrangement, {"ring", "sides"});
  light.arrangement = static_cast<Arrangement>(arrangement);
  table.number_if("level", light.level, 1, 255);
  table.number_if("led_radius_mm", light.led_radius_mm, 1, 50);
  table.number_if("led_distance_mm", light.led_distance_mm, 2, 100);
  table.number_if("fill", light.fill, 0, 1);
  table.number_if("vignetting", light.vignetting, 0, 0.9);
  table.finish();
}

void read_scene(std::string_view toml_text, const std::string& name,
                const std::filesystem::path& folder, Scene& scene) {
  const toml::table parsed = tomlfile::parse(toml_text, name);
  KeyReader root(parsed, name);
  root.text_if("sensor", scene.sensor);
  std::string calibration;
  root.text_if("calibration", calibration);
  if (!calibration.empty()) take_from_calibration(folder / calibration, scene);
  read_camera(root.table_if("camera"), scene.camera);

  KeyReader gel = root.table_if("gel");
  gel.number_if("thickness_mm", scene.gel.thickness_mm, kMinThicknessMm, kMaxThicknessMm);
  gel.number_if("youngs_modulus_mpa", scene.gel.youngs_modulus_mpa, 0.001, 10);
  gel.number_if("poisson", scene.gel.poisson, 0.4, 0.5);
  gel.number_if("grid_mm", scene.gel.grid_mm, 0.05, 0.5);
  gel.number_if("solve_step_mm", scene.gel.solve_step_mm, 0.02, 5);
  gel.number_if("taper_x", scene.gel.taper_x, -0.02, 0.02);
  gel.number_if("taper_y", scene.gel.taper_y, -0.02, 0.02);
  gel.number_if("texture", scene.gel.texture, 0, 0.02);
  gel.number_if("texture_mm", scene.gel.texture_mm, 0.05, 5);
  gel.finish();

  read_surface(root.table_if("surface"), scene.surface);
  read_optics(root.table_if("optics"), scene.optics, scene.gel.thickness_mm);
  read_light(root.table_if("light"), scene.light);

  KeyReader loop = root.table_if("loop");
  loop.number_if("from_s", scene.loop_from_s, 0, 1e5);
  loop.number_if("to_s", scene.loop_to_s, 0, 1e5);
  if (scene.loop_to_s != 0 && scene.loop_to_s <= scene.loop_from_s) {
    loop.fail("to_s", "must be later than from_s");
  }
  loop.finish();

  for (KeyReader& press : root.tables("press")) {
    scene.presses.push_back(read_press(press, folder, scene.gel.thickness_mm));
  }
  for (KeyReader& fault : root.tables("fault")) scene.faults.push_back(read_fault(fault));
  root.finish();
}

}  // namespace

double Scene::time_s(std::uint64_t sequence) const noexcept {
  const double t = static_cast<double>(sequence) / camera.fps;
  if (loop_to_s <= 0 || t < loop_to_s) return t;
  return loop_from_s + std::fmod(t - loop_from_s, loop_to_s - loop_from_s);
}

bool Scene::strikes(FaultKind kind, std::uint64_t sequence) const noexcept {
  return std::ranges::any_of(faults, [&](const Fault& fault) {
    return fault.kind == kind && sequence >= fault.frame && sequence - fault.frame < fault.frames;
  });
}

Scene default_scene() {
  Scene scene;
  read_scene(kDefaultScene, "default.toml", {}, scene);
  return scene;
}

Scene parse_scene(std::string_view toml, const std::string& name,
                  const std::filesystem::path& folder) {
  Scene scene = default_scene();
  scene.loop_from_s = 0;
  scene.loop_to_s = 0;
  scene.presses.clear();
  scene.faults.clear();
  read_scene(toml, name, folder, scene);
  return scene;
}

Scene load_scene(const std::filesystem::path& file) {
  return parse_scene(base::read_file(file), file.string(), file.parent_path());
}

Scene at_mode(Scene scene, int width, int height, double fps) {
  if (width < 64 || width > 4096 || height < 64 || height > 4096 || !(fps >= 1 && fps <= 240)) {
    throw std::runtime_error(
        fmt::format("the simulated camera has no mode {} x {} at {} frames a second: sides may be "
                    "64 to 4096 pixels, the rate 1 to 240",
                    width, height, fps));
  }
  scene.camera.mm_per_px *= static_cast<double>(scene.camera.width) / width;
  scene.camera.width = width;
  scene.camera.height = height;
  scene.camera.fps = fps;
  return scene;
}

}  // namespace dtact::hal::sim
