#include "tests/accuracy/force/held_out.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <random>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/calibrate.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "hal/sim/objects.hpp"
#include "tests/accuracy/table/configuration.hpp"
#include "tests/accuracy/table/sensor.hpp"
#include "tests/accuracy/thickness/thickness.hpp"
#include "tests/accuracy/whole/program.hpp"

namespace dtact::force {
namespace {

namespace fs = std::filesystem;
namespace sim = hal::sim;

constexpr std::uint64_t kContactFree = 60;  // frames, which the reference takes 45 of
constexpr std::uint64_t kPeriod = 30;       // frames from one press to the next
constexpr std::uint64_t kStill = 14;        // the judged frame after a press's begin
constexpr double kFps = 60;

/// Random numbers that are the same with every standard library.
class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(random_() >> 11U) * 0x1p-53;
  }
  std::size_t index(std::size_t count) { return random_() % count; }

 private:
  std::mt19937_64 random_;
};

struct Drawn {
  sim::Object object;
  double reach_mm;  ///< Range of its position, within the field.
};

Drawn draw_object(Draw& draw) {
  switch (draw.index(15)) {
    case 0:
      return {sim::ball(draw(1.5, 8)), 6};
    case 1:
      return {sim::ball_array(draw(1, 2), draw(3, 5), 2, 3), 3};
    case 2:
      return {sim::disc(draw(1.2, 4)), 6};
    case 3:
      return {sim::cube(draw(3, 7)), 6};
    case 4:
      return {sim::cylinder(draw(1.5, 4), draw(5, 10)), 5};
    case 5:
      return {sim::grating(draw(1.5, 3), draw(0.4, 1), draw(5, 9)), 5};
    case 6:
      return {sim::pin_board(), 1};
    case 7:
      return {sim::m4_nut(), 6};
    case 8:
      return {sim::m3_long_nut(), 5};
    case 9:
      return {sim::m5_hexagon_screw(), 6};
    case 10:
      return {sim::three_set_screws(), 4};
    case 11:
      return {sim::star(draw(3, 5)), 6};
    case 12:
      return {sim::screw_cap(), 4};
    case 13:
      return {sim::usb_c_plug(), 5};
    default:
      return {sim::key(), 2};
  }
}

sim::Scene empty_scene(double thickness_mm) {
  sim::Scene scene = thickness::sensor_of(thickness_mm);
  scene.gel.solve_step_mm = 5;  // only presses at rest are judged
  scene.loop_from_s = scene.loop_to_s = 0;
  scene.presses.clear();
  return scene;
}

/// Presses `object` in within 8 frames as the scene's next press.
void add_press(sim::Scene& scene, const sim::Object& object, sim::PressKey at) {
  const double begin = static_cast<double>(kContactFree + kPeriod * scene.presses.size()) / kFps;
  const double depth = at.depth_mm;
  std::vector<sim::PressKey> keys;
  for (const auto& [frames, share] : {std::pair{0, 0.0}, {8, 1.0}, {18, 1.0}, {24, 0.0}}) {
    at.time_s = begin + frames / kFps;
    at.depth_mm = share * depth;
    keys.push_back(at);
  }
  scene.presses.push_back({object, std::move(keys)});
}

std::uint64_t frame_of(std::size_t press) { return kContactFree + kPeriod * press + kStill; }

void write(const fs::path& file, const image::Grey8& image) {
  fs::create_directories(file.parent_path());
  base::write_file_atomically(file, image::encode_png(image));
}

std::string last_line(const std::string& text) {
  const std::string lines = text.substr(0, text.find_last_not_of('\n') + 1);
  return lines.substr(lines.find_last_of('\n') + 1);
}

std::string calibrate(const std::vector<std::string>& arguments) {
  std::ostringstream said;
  if (calibrate::run(arguments, said, said) != 0) {
    throw std::runtime_error(fmt::format("dtact-calibrate {}: {}", arguments.front(), said.str()));
  }
  return last_line(said.str());
}

/// Calibrates as a user does, with a ball of 4 mm, a disc and a kitchen scale.
std::string make_calibration(double thickness_mm, Calibrating calibrating, std::uint64_t seed,
                             const fs::path& folder) {
  constexpr double kNewtonsPerGram = 0.00980665;
  sim::Scene scene = empty_scene(thickness_mm);
  // The ball goes no deeper than half of its radius.
  const double deepest = std::min(0.85 * thickness_mm, 1.9);
  add_press(scene, sim::ball(4), {.x_mm = 0.4, .y_mm = -0.3, .depth_mm = deepest});
  for (int i = 0; i < 11; ++i) {
    add_press(scene, sim::ball(4),
              {.x_mm = 0.5, .y_mm = -0.4, .depth_mm = (0.08 + 0.08 * i) * deepest});
  }
  if (calibrating == Calibrating::ball_and_flat_end) {
    for (int i = 0; i < 5; ++i) {
      add_press(scene, sim::disc(2),
                {.x_mm = -0.7, .y_mm = 0.9, .depth_mm = (0.1 + 0.15 * i) * deepest});
    }
  }
  const std::size_t presses = scene.presses.size();
  const auto truth = std::make_shared<const sim::Truth>(scene);
  table::Sensor sensor(truth, table::configurations()[0], seed);
  for (std::uint64_t i = 0; i < 16; ++i) {
    write(folder / fmt::format("reference/{:02}.png", i), sensor.frame(i));
    if (i < 8) write(folder / fmt::format("ball/{}.png", i), sensor.frame(frame_of(0) - 4 + i));
  }
  const std::string made = (folder / "calibration").string();
  (void)calibrate({"depth", "--reference", (folder / "reference").string(), "--ball",
                   (folder / "ball").string(), "--radius-mm", "4.0", "--mm-per-px", "0.0413793",
                   "--centre", "400,300", "--crop", "580,580", "-o", made});
  std::string csv = "frames,force\n";
  for (std::size_t i = 1; i < presses; ++i) {
    const std::string name = fmt::format("load{}.png", i);
    write(folder / name, sensor.frame(frame_of(i)));
    csv += fmt::format("{},{}\n", name, std::round(truth->force_n(frame_of(i)) / kNewtonsPerGram));
  }
  base::write_file_atomically(folder / "pairs.csv", csv);
  return calibrate(
      {"force", "--calibration", made, "--pairs", (folder / "pairs.csv").string(), "--grams"});
}

}  // namespace

Trial try_held_out(double thickness_mm, Calibrating calibrating, std::uint64_t seed, int count,
                   const fs::path& folder, int sharpen_steps) {
  Trial trial;
  trial.calibration = make_calibration(thickness_mm, calibrating, seed, folder);
  Draw draw(seed);
  sim::Scene scene = empty_scene(thickness_mm);
  for (int i = 0; i < count; ++i) {
    const auto [object, reach] = draw_object(draw);
    sim::PressKey at{.x_mm = draw(-reach, reach),
                     .y_mm = draw(-reach, reach),
                     .depth_mm = thickness_mm * draw(0.05, 0.7),
                     .rotation_deg = draw(-180, 180)};
    if (draw.index(2) == 1) {
      at.tilt_x_deg = draw(-6, 6);
      at.tilt_y_deg = draw(-6, 6);
    }
    add_press(scene, object, at);
    trial.presses.push_back(
        {.object = object.kind, .thickness_mm = thickness_mm, .depth_mm = at.depth_mm});
  }
  const auto truth = std::make_shared<const sim::Truth>(scene);
  whole::Settings settings;
  settings.kind = whole::whole_map_kind();
  settings.seed = seed + 1;
  settings.daemon.reconstruction.sharpen = sharpen_steps;
  whole::Program program(truth, folder / "calibration", settings);
  std::uint64_t next = 0;
  for (std::size_t i = 0; i < trial.presses.size(); ++i) {
    v1::Frame frame;
    for (; next <= frame_of(i); ++next) {
      const std::string bytes = program.next();
      if (next == frame_of(i) && !frame.ParseFromString(bytes)) {
        throw std::runtime_error("a frame does not parse");
      }
    }
    HeldOut& press = trial.presses[i];
    press.true_n = truth->force_n(frame_of(i));
    press.in_contact = frame.contact().in_contact();
    press.valid = frame.contact().has_force_n();
    press.force_n = frame.contact().force_n();
    press.uncertainty_n = frame.contact().force_uncertainty_n();
    press.absence = frame.contact().force_absence();
  }
  return trial;
}

double ratio(const HeldOut& press) {
  return std::abs(press.force_n - press.true_n) / press.uncertainty_n;
}

double quantile(std::vector<double> values, double share) {
  std::ranges::sort(values);
  return values.at(static_cast<std::size_t>(share * static_cast<double>(values.size() - 1)));
}

}  // namespace dtact::force
