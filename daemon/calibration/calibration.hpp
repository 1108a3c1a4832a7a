#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "daemon/recon/lens.hpp"
#include "daemon/recon/model.hpp"

namespace dtact::calibration {

/// The gel as it was fitted to presses of a ball, with standard errors: for people, and for a
/// simulator of this sensor. Depth is made without it.
struct GelEstimate {
  /// A number and its standard error.
  struct Estimate {
    double value = 0;
    double error = 0;
    bool operator==(const Estimate&) const = default;
  };
  Estimate thickness_mm;
  Estimate narrow_mm;  ///< Scattering, as in the model's; here with its errors.
  Estimate wide_mm;
  Estimate narrow_weight;
  /// Where the response's slope is given, indentation / thickness, ascending; between them it is a
  /// straight line, beyond them constant. Share of the local light for each thickness indented.
  std::array<double, 5> indentation = {};
  std::array<Estimate, 5> slope = {};
  double bulge_factor = 1;     ///< On the slopes below zero: a kink there.
  double residual_levels = 0;  ///< Root mean square of what the fit leaves, grey levels.
  bool operator==(const GelEstimate&) const = default;
};

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
  std::optional<GelEstimate> gel;   ///< Where a gel was fitted to the presses.
  Origin origin;
};

/// The size of a camera's frames, pixels.
struct FrameSize {
  int width = 0;
  int height = 0;
};

/// Reads and checks a calibration folder, as parse(). Throws std::runtime_error with file, line,
/// key and fix.
[[nodiscard]] Calibration load(const std::filesystem::path& folder,
                               const std::optional<FrameSize>& camera = {});

/// Writes the folder so that at any moment it is either absent, the old one or the new one. Throws
/// std::runtime_error, also when the folder holds files that no calibration has.
void save(const Calibration& calibration, const std::filesystem::path& folder);

/// The two files' contents checked and taken apart without a folder (an upload). `where` names the
/// origin in error messages; the calibration's name is left empty. With `camera`, a calibration for
/// frames of another size is refused before anything of that size is made.
[[nodiscard]] Calibration parse(const std::string& toml, const std::string& reference_png,
                                const std::string& where,
                                const std::optional<FrameSize>& camera = {});

/// The rectification of a depth map: through the lens, or the crop where there is none. `outside`
/// becomes depth-map sized with 1 where the frame does not show the pixel, or empty. Throws
/// std::invalid_argument as recon::make_crop_table() and recon::make_lens_table().
[[nodiscard]] recon::RectifyTable map_table(const std::optional<recon::Lens>& lens, int frame_width,
                                            int frame_height, const recon::MapPlace& place,
                                            std::vector<std::uint8_t>& outside);

/// Marks in the model what `outside` marks.
void add_untrusted(recon::Model& model, const std::vector<std::uint8_t>& outside);

/// SHA-256 of `bytes` as 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace dtact::calibration
