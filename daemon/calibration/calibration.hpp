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

/// How a camera's height above the surface is known.
enum class HeightSource : std::uint8_t {
  unknown,  ///< Depth is placed as it is seen.
  assumed,  ///< The height that real sensors of this family have, kAssumedPerMm.
  board,    ///< A board of pins.
  drawing,  ///< The maker's drawing.
  presses   ///< Presses of a ball at several places.
};

/// Where the camera stands above the surface, and how well that is known.
struct CameraView {
  /// Foot of the camera's axis on the surface: millimetres of the lens, from the map's centre
  /// where there is no lens, and in a Calibration always.
  recon::Point foot_mm;
  HeightSource source = HeightSource::unknown;
  double per_mm = 0;  ///< 1 / height above the surface; 0: not known yet.
  /// A board shows 1 / height in grey levels: the share of a point's distance from the foot by
  /// which it is seen farther out, for each grey level of darkening. A LUT makes millimetres of it.
  double per_level = 0;
  double error = 0;  ///< Standard error of per_mm, or of per_level where only that is known.

  [[nodiscard]] bool operator==(const CameraView&) const = default;
};

/// 1 / height of real sensors: eight boards give 0.029 to 0.054, and one height of 20 to 30 mm
/// improves seven of eight sensors.
inline constexpr double kAssumedPerMm = 1.0 / 30;
/// Heights that are believed, 1/mm.
inline constexpr double kMinPerMm = 0.015;
inline constexpr double kMaxPerMm = 0.08;

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
  std::string scale_from;          ///< How mm_per_px was found; empty = not recorded.
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
  CameraView view;                  ///< What model->surface.view was made from.
  std::optional<GelEstimate> gel;   ///< Where a gel was fitted to the presses.
  Origin origin;
};

/// The size of a camera's frames, pixels, and of the JPEGs that they are decoded from.
struct FrameSize {
  int width = 0;
  int height = 0;
  int decode_scale = 1;  ///< The JPEGs are this many times as wide and as high.

  /// Frames of a calibration of this size can be had: they are the frames or the JPEGs.
  [[nodiscard]] bool gives(int frame_width, int frame_height) const noexcept {
    return (frame_width == width && frame_height == height) ||
           (frame_width == width * decode_scale && frame_height == height * decode_scale);
  }
  /// "400x300 (decoded from 800x600)".
  [[nodiscard]] std::string text() const;
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

/// The calibration for frames that are decoded at 1/`scale` of their size: itself at 1. Throws as
/// recon::for_scaled_frames().
[[nodiscard]] std::shared_ptr<const Calibration> for_scaled_frames(
    std::shared_ptr<const Calibration> calibration, int scale);

/// Marks in the model what `outside` marks.
void add_untrusted(recon::Model& model, const std::vector<std::uint8_t>& outside);

/// SHA-256 of `bytes` as 64 lower-case hexadecimal digits.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace dtact::calibration
