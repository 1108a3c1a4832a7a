#include "daemon/calibration/sensor_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

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

}  // namespace dtact::calibration
