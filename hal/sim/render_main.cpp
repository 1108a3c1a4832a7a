// dtact-sim-render: frames of a simulated scene as PNG files, for calibration and for looking at.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/sim/calibrated.hpp"
#include "hal/sim/renderer.hpp"
#include "version.hpp"

namespace {

using dtact::hal::Light;
namespace sim = dtact::hal::sim;

struct Arguments {
  std::filesystem::path scene;
  std::filesystem::path calibration;
  std::string frames = "0:1";
  std::uint64_t seed = 1;
  int brightness = 255;
  bool average = false;
  std::filesystem::path output;
  std::filesystem::path truth;
};

struct Range {
  std::uint64_t first = 0;
  std::uint64_t end = 0;
};

// "200:210" are the ten frames 200 to 209; "200" is one.
Range parse_range(const std::string& text) {
  Range range;
  const char* const end = text.data() + text.size();
  auto parsed = std::from_chars(text.data(), end, range.first);
  range.end = range.first + 1;
  if (parsed.ec == std::errc() && parsed.ptr != end && *parsed.ptr == ':') {
    parsed = std::from_chars(parsed.ptr + 1, end, range.end);
  }
  if (parsed.ec == std::errc() && parsed.ptr == end && range.end > range.first) return range;
  throw std::runtime_error(fmt::format(
      "--frames {}: must be a frame or first:end with end after first, as in 200:210", text));
}

// A line for each frame: its number, the scene's time, the force, and of every press (numbered as
// in the scene) its object's pose, empty while that is away.
std::string truth_csv(const sim::Truth& truth, const Range& range) {
  const std::size_t presses = truth.scene().presses.size();
  std::string csv = "frame,time_s,force_n";
  for (std::size_t i = 0; i < presses; ++i) {
    for (const char* column : {"x_mm", "y_mm", "z_mm", "turn_x_deg", "turn_y_deg", "turn_z_deg"}) {
      csv += fmt::format(",{}_{}", column, i);
    }
  }
  csv += '\n';
  for (std::uint64_t n = range.first; n < range.end; ++n) {
    csv += fmt::format("{},{},{}", n, truth.scene().time_s(n), truth.force_n(n));
    for (std::size_t i = 0; i < presses; ++i) {
      if (const auto pose = truth.pose(i, n)) {
        csv += fmt::format(",{},{},{},{}", pose->x_mm, pose->y_mm, pose->z_mm,
                           fmt::join(pose->turn_deg, ","));
      } else {
        csv += ",,,,,,";
      }
    }
    csv += '\n';
  }
  return csv;
}

void render(const Arguments& arguments) {
  sim::Scene scene =
      arguments.scene.empty() ? sim::default_scene() : sim::load_scene(arguments.scene);
  if (!arguments.calibration.empty()) sim::take_from_calibration(arguments.calibration, scene);
  const Range range = parse_range(arguments.frames);
  sim::Renderer renderer(scene, arguments.seed);
  Light light;
  light.brightness = static_cast<std::uint8_t>(arguments.brightness);
  const sim::LedLevels levels = sim::led_levels(light);
  if (!arguments.truth.empty()) {
    dtact::base::write_file_atomically(arguments.truth, truth_csv(renderer.truth(), range));
  }

  const auto pixels =
      static_cast<std::size_t>(scene.camera.width) * static_cast<std::size_t>(scene.camera.height);
  dtact::image::Grey8 image{scene.camera.width, scene.camera.height, {}};
  image.pixels.resize(pixels);
  std::vector<std::uint64_t> sums(pixels);
  for (std::uint64_t n = range.first; n < range.end; ++n) {
    renderer.render(n, levels, image.pixels.data(), image.width, image.height);
    if (arguments.average) {
      for (std::size_t i = 0; i < pixels; ++i) sums[i] += image.pixels[i];
    } else {
      const auto file = range.end - range.first == 1
                            ? arguments.output
                            : arguments.output / fmt::format("{:06}.png", n);
      if (file.has_parent_path()) std::filesystem::create_directories(file.parent_path());
      dtact::base::write_file_atomically(file, dtact::image::encode_png(image));
    }
  }
  if (!arguments.average) return;
  // 16 bits, so that the average keeps its fractions of a grey level.
  dtact::image::Grey16 mean{image.width, image.height, std::vector<std::uint16_t>(pixels)};
  const std::uint64_t count = range.end - range.first;
  for (std::size_t i = 0; i < pixels; ++i) {
    mean.pixels[i] = static_cast<std::uint16_t>((sums[i] * 257 + count / 2) / count);
  }
  dtact::base::write_file_atomically(arguments.output, dtact::image::encode_png(mean));
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app("Writes frames of a simulated scene as PNG files.", "dtact-sim-render");
    app.set_version_flag("--version", "dtact-sim-render " DTACT_VERSION);
    Arguments arguments;
    app.add_option("--scene", arguments.scene, "scene file; left out: the built-in scene")
        ->check(CLI::ExistingFile);
    app.add_option("--calibration", arguments.calibration,
                   "folder of a calibration made by a model: render that sensor's gel and light")
        ->check(CLI::ExistingDirectory);
    app.add_option("--frames", arguments.frames, "frame, or first:end without the end");
    app.add_option("--seed", arguments.seed, "noise seed");
    app.add_option("--brightness", arguments.brightness, "all LEDs white at this brightness")
        ->check(CLI::Range(0, 255));
    app.add_flag("--average", arguments.average, "one 16-bit image, the mean of the frames");
    app.add_option("-o,--output", arguments.output, "PNG file for one image, folder for several")
        ->required();
    app.add_option("--truth", arguments.truth,
                   "CSV file: the true force and the objects' poses in each of the frames");
    CLI11_PARSE(app, argc, argv);
    render(arguments);
    return 0;
  } catch (const std::exception& problem) {
    fmt::print(stderr, "dtact-sim-render: {}\n", problem.what());
    return 1;
  }
}
