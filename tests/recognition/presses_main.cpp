// recognition_presses: simulated presses for training and tests of the recognition.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>

#include "tests/recognition/objects.hpp"
#include "tests/recognition/presses.hpp"

namespace {

namespace rec = dtact::recognition;

struct Arguments {
  std::filesystem::path folder;
  rec::Wanted wanted;
  int sensors = 1;
  int first_kind = 0;
  int last_kind = 30;
  int first_variant = 0;
  int last_variant = 7;
  double known = 0.7;
  bool images = false;
};

// The middle of a camera image, as many columns as rows.
void write_square(const dtact::image::Grey8& image, std::ofstream& out) {
  const int left = (image.width - image.height) / 2;
  for (int row = 0; row < image.height; ++row) {
    const auto begin = static_cast<std::size_t>(row) * static_cast<std::size_t>(image.width) +
                       static_cast<std::size_t>(left);
    out.write(reinterpret_cast<const char*>(&image.pixels[begin]), image.height);
  }
}

void make(Arguments& arguments) {
  std::filesystem::create_directories(arguments.folder);
  std::ofstream maps(arguments.folder / "maps.i16", std::ios::binary);
  std::ofstream truth(arguments.folder / "truth.csv");
  maps.exceptions(std::ios::failbit | std::ios::badbit);
  truth.exceptions(std::ios::failbit | std::ios::badbit);
  std::ofstream images;
  images.exceptions(std::ios::failbit | std::ios::badbit);
  if (arguments.images) images.open(arguments.folder / "images.u8", std::ios::binary);
  truth << "sensor,thickness_mm,kind,variant,press,depth_mm,x_mm,y_mm,newtons,deepest_mm,area_mm2,"
           "cut\n";
  arguments.wanted.object = [&](dtact::whole::Draw& draw) {
    // The shares of the twelve classes and of the others, whatever their numbers.
    const bool known = arguments.last_kind < rec::kClasses ||
                       (arguments.first_kind < rec::kClasses && draw.chance(arguments.known));
    const int first = known ? arguments.first_kind : std::max(arguments.first_kind, rec::kClasses);
    const int last = known ? std::min(arguments.last_kind, rec::kClasses - 1) : arguments.last_kind;
    return std::pair{draw.between(first, last),
                     draw.between(arguments.first_variant, arguments.last_variant)};
  };
  int refused = 0;
  int written = 0;
  for (int i = 0; i < arguments.sensors; ++i) {
    const int sensor = arguments.wanted.sensor;
    refused +=
        make_presses(arguments.wanted,
                     [&](const rec::Press& press, const dtact::perceive::TouchMap& map,
                         const dtact::image::Grey8& image) {
                       std::vector<std::int16_t> um;
                       for (const float mm : map.mm) {
                         um.push_back(static_cast<std::int16_t>(std::lround(1000 * mm)));
                       }
                       maps.write(reinterpret_cast<const char*>(um.data()),
                                  static_cast<std::streamsize>(um.size() * sizeof(um[0])));
                       truth << fmt::format(
                           "{},{:.3f},{},{},{},{:.3f},{:.2f},{:.2f},{:.2f},{:.3f},{:.2f},{:.3f}\n",
                           sensor, press.thickness_mm, press.kind, press.variant, press.number,
                           press.depth_mm, press.x_mm, press.y_mm, press.newtons, map.deepest_mm,
                           map.area_mm2, map.cut);
                       if (images.is_open()) write_square(image, images);
                       ++written;
                     })
            ? 0
            : 1;
    ++arguments.wanted.sensor;
    maps.flush();
    truth.flush();
    fmt::print("sensor {}: {} presses in all, {} calibrations refused\n", sensor, written, refused);
    std::fflush(stdout);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    CLI::App app(
        "Writes simulated presses: maps.i16 (96 x 96 values each, micrometres, int16), truth.csv; "
        "with --images the camera images, images.u8.",
        "recognition_presses");
    Arguments arguments;
    app.add_option("folder", arguments.folder, "folder for the files")->required();
    app.add_option("--seed", arguments.wanted.seed, "of the sensors and presses");
    app.add_option("--first-sensor", arguments.wanted.sensor, "number of the first sensor");
    app.add_option("--sensors", arguments.sensors, "number of sensors");
    app.add_option("--presses", arguments.wanted.presses, "on each sensor");
    app.add_option("--frames", arguments.wanted.frames,
                   "of each press, each as deep as it is drawn");
    app.add_option("--lights", arguments.wanted.lights, "1: the calibration's light alone");
    app.add_flag("--images", arguments.images,
                 "write the camera images, too: the middle square, one byte a pixel");
    app.add_option("--first-kind", arguments.first_kind, "kinds from here");
    app.add_option("--last-kind", arguments.last_kind, "up to here; 30: without those for tests");
    app.add_option("--first-variant", arguments.first_variant, "variants from here");
    app.add_option("--last-variant", arguments.last_variant, "up to here");
    app.add_option("--known", arguments.known, "share of the twelve classes");
    app.add_option("--grid-mm", arguments.wanted.grid_mm, "spacing of the contact's grid");
    app.add_option("--camera-width", arguments.wanted.camera_width, "pixels");
    CLI11_PARSE(app, argc, argv);
    make(arguments);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "recognition_presses: {}\n", error.what());
    return 1;
  }
}
