#include "daemon/calibration/sensor_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "daemon/calibration/text.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::calibration {
namespace {

void read_camera(KeyReader camera, Origin& origin) {
  origin.camera = camera.text("identity");
  origin.pixel_format = camera.text("pixel_format");
  origin.fps = camera.number("fps", 0, 100000);
  KeyReader controls = camera.table("controls");
  for (const std::string& name : controls.keys()) {
    origin.controls.push_back({name, controls.integer(name, INT64_MIN, INT64_MAX)});
  }
  camera.finish();
}

void read_light(KeyReader light, Origin& origin) {
  for (const std::int64_t value : light.integers("leds", 0, 255)) {
    origin.leds.push_back(static_cast<std::uint8_t>(value));
  }
  if (origin.leds.size() % 3 != 0) light.fail("leds", "expected r, g, b of each LED");
  light.finish();
}

}  // namespace

std::string toml_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      out += fmt::format("\\u{:04X}", static_cast<unsigned>(static_cast<unsigned char>(c)));
    } else {
      out += c;
    }
  }
  return out + "\"";
}

std::string format_camera_and_light(const Origin& origin) {
  std::string t = fmt::format(
      "[camera]  # empty or 0: not recorded\nidentity = {}\npixel_format = {}\n"
      "fps = {}\n\n[camera.controls]\n",
      toml_string(origin.camera), toml_string(origin.pixel_format), origin.fps);
  for (const Control& control : origin.controls) {
    t += fmt::format("{} = {}\n", toml_string(control.name), control.value);
  }
  t += fmt::format(
      "\n[light]  # r, g, b of each LED after brightness; empty: not recorded\n"
      "leds = [{}]\n\n",
      fmt::join(origin.leds, ", "));
  return t;
}

void read_camera_and_light(KeyReader& top, Origin& origin) {
  read_camera(top.table("camera"), origin);
  read_light(top.table("light"), origin);
}

std::string format_sensor(const Origin& origin) {
  return fmt::format(
             "# Camera and light of the images in this folder. Written by dtactctl calibrate.\n"
             "version = {}\n\n",
             kFormatVersion) +
         format_camera_and_light(origin);
}

Origin load_sensor(const std::filesystem::path& path) {
  const toml::table document = parse_toml(base::read_file(path), path.string());
  KeyReader top(document, path.string());
  (void)top.integer("version", kFormatVersion, kFormatVersion);
  Origin origin;
  read_camera_and_light(top, origin);
  top.finish();
  return origin;
}

}  // namespace dtact::calibration
