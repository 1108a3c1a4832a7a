#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/calibration/calibration.hpp"
#include "daemon/recon/flat_field_gain.hpp"
#include "daemon/recon/lens.hpp"
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
/// file, line, key and fix.
[[nodiscard]] Origin load_sensor(const std::filesystem::path& path);

/// A lens, the camera frame it was measured in, and the gain measured from the same images: what
/// `dtact-calibrate lens` writes.
struct LensFile {
  int frame_width = 0;
  int frame_height = 0;
  recon::Lens lens;
  recon::FlatFieldGain gain;       ///< Places in millimetres of the lens's surface.
  std::vector<std::string> notes;  ///< Comment lines: how it was measured and how well it fits.
  bool gain_specified = false;     ///< A board said so, also where `gain` is none.
  CameraView view;
};

/// The keys of a `[lens]` table, one a line, without the header. Numbers are read back exactly.
[[nodiscard]] std::string format_lens(const recon::Lens& lens);

/// Takes a `[lens]` table's keys; an empty table is no lens. Throws as KeyReader.
[[nodiscard]] std::optional<recon::Lens> read_lens(tomlfile::KeyReader reader, int frame_width,
                                                   int frame_height);

/// The text of a lens file.
[[nodiscard]] std::string format(const LensFile& file);

/// Reads a lens file, or the lens of a calibration folder (without its gain, which belongs to its
/// LUT). Throws std::runtime_error with file,
/// line, key and fix.
[[nodiscard]] LensFile load_lens(const std::filesystem::path& path);

}  // namespace dtact::calibration
