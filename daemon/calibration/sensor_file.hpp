#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "daemon/calibration/calibration.hpp"
#include "hal/files/key_reader.hpp"

namespace dtact::calibration {

/// Lies in a folder of images and says under which camera and light they were taken, so that a
/// calibration made from them records both.
inline constexpr const char* kSensorName = "sensor.toml";

/// Camera, controls and light as the tables [camera], [camera.controls] and [light].
[[nodiscard]] std::string format_camera_and_light(const Origin& origin);
/// Takes those tables. Throws as KeyReader.
void read_camera_and_light(tomlfile::KeyReader& top, Origin& origin);

/// The text of a sensor file.
[[nodiscard]] std::string format_sensor(const Origin& origin);
/// Camera, controls and light of a sensor file; the rest is empty. Throws std::runtime_error with
/// file, line, key and remedy.
[[nodiscard]] Origin load_sensor(const std::filesystem::path& path);

}  // namespace dtact::calibration
