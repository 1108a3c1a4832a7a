#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/calibration/layer.hpp"
#include "daemon/recon/lens.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// One photometric control at calibration time (the shape of hal::CameraControl, without the HAL).
struct Control {
  std::string name;
  std::int64_t value = 0;
};

/// Under what the calibration was made: what a running sensor is compared with.
struct Origin {
  std::string camera;        ///< Stable identity; empty = not recorded (built from images alone).
  std::string pixel_format;  ///< "MJPEG", ...; empty = not recorded.
  double fps = 0;            ///< 0 = not recorded.
  std::vector<Control> controls;
  std::vector<std::uint8_t> leds;  ///< r, g, b that each LED emits; empty = not recorded.
  std::string created;             ///< ISO 8601, UTC.
  struct Source {
    std::string name;    ///< File name, without folder.
    std::string sha256;  ///< Hex.
  };
  std::vector<Source> sources;
};

/// A calibration folder in memory: `calibration.toml` and `reference.png` (16-bit grey, Q8 luma).
struct Calibration {
  std::string name;  ///< The folder's name.
  std::shared_ptr<const recon::Model> model;
  /// Upper left corner of the depth map, pixels of the frame or, with a lens, of the rectified
  /// image (recon::MapPlace), which has the frame's size.
  int crop_col = 0;
  int crop_row = 0;
  std::optional<recon::Lens> lens;  ///< None: the depth map is a part of the frame as it is.
  std::optional<Layer> layer;       ///< Where a layer was fitted to the presses.
  Origin origin;
};

/// Reads and checks a calibration folder. Throws std::runtime_error with file, line, key and
/// remedy.
[[nodiscard]] Calibration load(const std::filesystem::path& folder);

/// Writes the folder so that at any moment it is either absent, the old one or the new one. Throws
/// std::runtime_error, also when the folder holds files that no calibration has.
void save(const Calibration& calibration, const std::filesystem::path& folder);

/// The two files' contents checked and taken apart without a folder (an upload). `where` names the
/// origin in error messages; the calibration's name is left empty.
[[nodiscard]] Calibration parse(const std::string& toml, const std::string& reference_png,
                                const std::string& where);

}  // namespace dtact::calibration
