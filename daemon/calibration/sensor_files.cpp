#include "daemon/calibration/sensor_files.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>

#include "daemon/calibration/calibration.hpp"
#include "daemon/calibration/tables.hpp"
#include "daemon/calibration/text.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::calibration {
namespace {

void read_camera(tomlfile::KeyReader camera, Origin& origin) {
  origin.camera = camera.text("identity");
  origin.pixel_format = camera.text("pixel_format");
  origin.fps = camera.number("fps", 0, 100000);
  tomlfile::KeyReader controls = camera.table("controls");
  for (const std::string& name : controls.keys()) {
    origin.controls.push_back({name, controls.integer(name, INT64_MIN, INT64_MAX)});
  }
  camera.finish();
}

void read_light(tomlfile::KeyReader light, Origin& origin) {
  for (const std::int64_t value : light.integers("leds", 0, 255)) {
    origin.leds.push_back(static_cast<std::uint8_t>(value));
  }
  if (origin.leds.size() % 3 != 0) light.fail("leds", "expected r, g, b of each LED");
  light.finish();
}

constexpr double kReach = 1e6;  // of any number in the table, pixels or pixels per millimetre

}  // namespace

std::string format_camera_and_light(const Origin& origin) {
  std::string t = fmt::format(
      "[camera]  # empty or 0: not recorded\nidentity = {}\npixel_format = {}\n"
      "fps = {}\n\n[camera.controls]\n",
      tomlfile::quoted(origin.camera), tomlfile::quoted(origin.pixel_format), origin.fps);
  for (const Control& control : origin.controls) {
    t += fmt::format("{} = {}\n", tomlfile::quoted(control.name), control.value);
  }
  t += fmt::format(
      "\n[light]  # r, g, b of each LED after brightness; empty: not recorded\n"
      "leds = [{}]\n\n",
      fmt::join(origin.leds, ", "));
  return t;
}

void read_camera_and_light(tomlfile::KeyReader& top, Origin& origin) {
  read_camera(top.table("camera"), origin);
  read_light(top.table("light"), origin);
}

std::string format_sensor(const Origin& origin) {
  return fmt::format(
             "# Camera and light of the images in this folder. Written by dtact-calibrate.\n"
             "version = {}\n\n",
             kFormatVersion) +
         format_camera_and_light(origin);
}

Origin load_sensor(const std::filesystem::path& path) {
  const toml::table document = tomlfile::parse(base::read_file(path), path.string());
  tomlfile::KeyReader top(document, path.string());
  (void)top.integer("version", kFormatVersion, kFormatVersion);
  Origin origin;
  read_camera_and_light(top, origin);
  top.finish();
  return origin;
}

std::string format_lens(const recon::Lens& lens) {
  return fmt::format(
      "homography = [{}]  # mm on the surface to undistorted pixels\n"
      "centre_col = {}\ncentre_row = {}  # of the distortion, pixels\n"
      "radius_px = {}\nradial = [{}]  # k1, k2, ... of (distance / radius_px)^2, ^4, ...\n",
      fmt::join(lens.homography, ", "), lens.centre_col, lens.centre_row, lens.radius_px,
      fmt::join(lens.radial, ", "));
}

std::optional<recon::Lens> read_lens(tomlfile::KeyReader reader, int frame_width,
                                     int frame_height) {
  if (reader.keys().empty()) return std::nullopt;
  recon::Lens lens;
  const std::vector<double> homography = reader.numbers("homography", -kReach, kReach);
  if (homography.size() != lens.homography.size()) {
    reader.fail("homography", "expected nine numbers");
  }
  std::ranges::copy(homography, lens.homography.begin());
  lens.centre_col = reader.number("centre_col", -kReach, kReach);
  lens.centre_row = reader.number("centre_row", -kReach, kReach);
  lens.radius_px = reader.number("radius_px", 1, kReach);
  lens.radial = reader.numbers("radial", -kReach, kReach);
  if (lens.radial.size() > recon::Lens::kMaxRadial) {
    reader.fail("radial", fmt::format("expected at most {} numbers", recon::Lens::kMaxRadial));
  }
  reader.finish();
  try {
    recon::check(lens, frame_width, frame_height);
  } catch (const std::invalid_argument& e) {
    reader.fail("", e.what());
  }
  return lens;
}

std::string format(const LensFile& file) {
  std::string t = "# A lens of dtactd. Written by dtact-calibrate lens.\n";
  for (const std::string& note : file.notes) t += fmt::format("# {}\n", note);
  t += fmt::format("version = {}\n\n[frame]\nwidth = {}\nheight = {}\n\n[lens]\n", kFormatVersion,
                   file.frame_width, file.frame_height);
  t += format_lens(file.lens) + "\n" + format_view(file.view);
  return file.gain_specified ? t + format_gain(file.gain) : t;
}

LensFile load_lens(const std::filesystem::path& path) {
  if (std::filesystem::is_directory(path)) {
    const Calibration calibration = load(path);
    if (!calibration.lens) {
      throw std::runtime_error(
          path.string() + ": this calibration has no lens; make one with dtact-calibrate lens");
    }
    const recon::RectifyTable& map = calibration.model->rectify;
    const recon::Point centre = surface_point(*calibration.lens,
                                              {calibration.crop_col, calibration.crop_row,
                                               map.width, map.height, calibration.model->mm_per_px},
                                              0.5 * (map.width - 1), 0.5 * (map.height - 1));
    LensFile file{map.frame_width, map.frame_height, *calibration.lens, {}, {},
                  false,           calibration.view};
    file.view.foot_mm.x += centre.x;
    file.view.foot_mm.y += centre.y;
    return file;
  }
  const toml::table document = tomlfile::parse(base::read_file(path), path.string());
  tomlfile::KeyReader top(document, path.string());
  (void)top.integer("version", kFormatVersion, kFormatVersion);
  LensFile file;
  tomlfile::KeyReader frame = top.table("frame");
  file.frame_width = static_cast<int>(frame.integer("width", 2, kMaxPixels));
  file.frame_height = static_cast<int>(frame.integer("height", 2, kMaxPixels));
  frame.finish();
  const std::optional<recon::Lens> lens =
      read_lens(top.table("lens"), file.frame_width, file.frame_height);
  file.gain_specified = top.has("gain");
  if (file.gain_specified) file.gain = read_gain(top.table("gain"));
  if (top.has("viewpoint")) file.view = read_view(top.table("viewpoint"));
  top.finish();
  if (!lens) top.fail("lens", "is empty; make a lens with dtact-calibrate lens");
  file.lens = *lens;
  return file;
}

}  // namespace dtact::calibration
