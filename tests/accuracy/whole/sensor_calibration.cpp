#include "tests/accuracy/whole/sensor_calibration.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clients/calibrate/calibrate.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "hal/sim/objects.hpp"
#include "hal/sim/renderer.hpp"

namespace dtact::whole {
namespace {

namespace fs = std::filesystem;
namespace sim = hal::sim;

constexpr double kPeriodS = 1;  // from one press to the next
constexpr std::uint64_t kContactFree = 32;
constexpr std::uint64_t kImages = 24;  // of a press for a lookup table or a lens
constexpr std::uint64_t kForceImages = 4;
constexpr double kNewtonsPerGram = 0.00980665;

struct Load {
  sim::Object object;
  double share;  ///< Depth as a share of the gel.
  double x_mm = 0;
  double y_mm = 0;
};

/// The sensor with loads pressed in one after another, and their images in folders.
class Bench {
 public:
  Bench(const RandomSensor& sensor, const std::vector<Load>& loads, fs::path folder)
      : renderer_(with(sensor.scene, loads), sensor.seed), folder_(std::move(folder)) {}

  std::string reference_image() { return images("no_contact", 0, kContactFree); }
  std::string load(std::size_t index, std::uint64_t count = kImages) {
    return images(fmt::format("load{}", index), frame_of(index), count);
  }
  [[nodiscard]] double newtons(std::size_t index) const {
    return renderer_.truth().force_n(frame_of(index));
  }

 private:
  static sim::Scene with(sim::Scene scene, const std::vector<Load>& loads) {
    scene.gel.solve_step_mm = 5;
    for (std::size_t i = 0; i < loads.size(); ++i) {
      const Load& load = loads[i];
      const double begin = kPeriodS * static_cast<double>(i + 1);
      const auto key = [&](double after, double share) {
        return sim::PressKey{.time_s = begin + after,
                             .x_mm = load.x_mm,
                             .y_mm = load.y_mm,
                             .depth_mm = share * scene.gel.thickness_mm};
      };
      scene.presses.push_back(
          {load.object, {key(0, 0), key(0.1, load.share), key(0.9, load.share), key(0.95, 0)}});
    }
    return scene;
  }
  static std::uint64_t frame_of(std::size_t index) { return 60 * (index + 1) + 20; }

  std::string images(const std::string& name, std::uint64_t first, std::uint64_t count) {
    const fs::path folder = folder_ / name;
    fs::create_directories(folder);
    const sim::CameraModel& camera = renderer_.truth().scene().camera;
    image::Grey8 picture{camera.width, camera.height, {}};
    picture.pixels.resize(static_cast<std::size_t>(camera.width) *
                          static_cast<std::size_t>(camera.height));
    for (std::uint64_t n = first; n < first + count; ++n) {
      renderer_.render(n, sim::led_levels({}), picture.pixels.data(), camera.width, camera.height);
      base::write_file_atomically(folder / fmt::format("{:04}.png", n), image::encode_png(picture));
    }
    return folder.string();
  }

  sim::Renderer renderer_;
  fs::path folder_;
};

/// Runs dtact-calibrate. Returns its output.
std::string run(const std::vector<std::string>& arguments) {
  std::ostringstream out;
  std::ostringstream error;
  if (calibrate::run(arguments, out, error) != 0) throw std::runtime_error(error.str());
  return out.str();
}

std::string lens_of(const RandomSensor& sensor, const fs::path& work, std::string& printed) {
  Bench bench(sensor, {{sim::pin_board(), 0.35}}, work / "board");
  const std::string lens = (work / "lens.toml").string();
  printed += run(
      {"lens", "--board-reference", bench.reference_image(), "--board", bench.load(0), "-o", lens});
  return lens;
}

void calibrate_depth(const RandomSensor& sensor, const fs::path& work, const fs::path& folder,
                     std::string& printed) {
  std::vector<std::string> map = {"--mm-per-px", "0.0413793", "--centre",
                                  "400,300",     "--crop",    "580,580"};
  if (sensor.has_lens()) map.insert(map.end(), {"--lens", lens_of(sensor, work, printed)});
  constexpr std::array kShares{0.5, 0.6, 0.7};
  std::vector<Load> loads;
  for (const double share : kShares) loads.push_back({sim::ball(4), share, 0.7, -0.5});
  Bench bench(sensor, loads, work / "ball");
  std::string refused;
  for (std::size_t i = 0; i < loads.size(); ++i) {
    std::vector<std::string> arguments = {"depth",  "--reference", bench.reference_image(),
                                          "--ball", bench.load(i), "--radius-mm",
                                          "4",      "-o",          folder.string()};
    arguments.insert(arguments.end(), map.begin(), map.end());
    try {
      printed += run(arguments);
      return;
    } catch (const std::runtime_error& error) {
      refused += error.what();
      printed += fmt::format("refused: {}", error.what());
    }
  }
  throw std::runtime_error(refused);
}

void calibrate_force(const RandomSensor& sensor, const fs::path& work, const fs::path& folder,
                     std::string& printed) {
  std::vector<Load> loads;
  for (const double share : {0.1, 0.16, 0.24, 0.34}) {
    loads.push_back({sim::ball(3), share, -1.5, 1.2});
    loads.push_back({sim::ball(6), share, 1.8, 0.4});
  }
  for (const double share : {0.08, 0.12, 0.18})
    loads.push_back({sim::disc(2.5), share, -0.6, -1.7});
  Bench bench(sensor, loads, work / "force");
  std::vector<std::string> arguments = {"force", "--calibration", folder.string(), "--reference",
                                        bench.reference_image()};
  for (std::size_t i = 0; i < loads.size(); ++i) {
    const double newtons = std::round(bench.newtons(i) / kNewtonsPerGram) * kNewtonsPerGram;
    arguments.insert(arguments.end(),
                     {"--pair", fmt::format("{}@{:.3f}", bench.load(i, kForceImages), newtons)});
  }
  try {
    printed += run(arguments);
  } catch (const std::runtime_error& error) {  // this sensor has no force calibration
    printed += fmt::format("force refused: {}", error.what());
  }
}

}  // namespace

std::string calibrate(const RandomSensor& sensor, const fs::path& folder) {
  const fs::path work = folder.string() + ".work";
  fs::remove_all(work);
  fs::create_directories(work);
  std::string printed;
  calibrate_depth(sensor, work, folder, printed);
  calibrate_force(sensor, work, folder, printed);
  fs::remove_all(work);
  return printed;
}

}  // namespace dtact::whole
