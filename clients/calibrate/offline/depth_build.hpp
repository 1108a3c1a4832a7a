#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/press_set.hpp"
#include "clients/calibrate/lens/pin_shift.hpp"
#include "clients/calibrate/offline/images.hpp"

namespace dtact::ctl {

/// Position of the depth map in the frame and size of its pixels, from the command line.
struct MapOptions {
  double mm_per_px = 0;  ///< 0: the lens's in the middle, or the ruler's.
  /// x, y of two points of the picture, pixels, and their distance, mm; or empty.
  std::vector<double> ruler;
  double camera_mm = 0;  ///< Of the camera above the surface; 0: the lens file's.
  std::string lens;  ///< A lens file or a calibration folder; empty: the frame is not rectified.
  std::vector<int> centre;  ///< x, y in pixels; empty: the frame's.
  std::vector<int> crop;    ///< Width, height in pixels; empty: the whole frame.
};

/// Adds --mm-per-px, --ruler, --lens, --centre and --crop.
void add_map_options(CLI::App& command, MapOptions& options);

/// The same, for a frame of known size.
struct MapChoice {
  std::optional<recon::Lens> lens;
  recon::FlatFieldGain gain;    ///< From the lens file: the gain of its board's pins.
  bool gain_specified = false;  ///< LensFile::gain_specified.
  double mm_per_px = 0;
  std::string scale_from;  ///< calibration::Origin::scale_from.
  std::optional<calibration::Crop> crop;
  calibration::CameraView view = {};
};

/// Throws std::runtime_error naming the option when there is no scale, ruler or lens, the ruler's
/// points are no good, the lens is for another frame size or the centre is given alone.
[[nodiscard]] MapChoice choose_map(const MapOptions& options, int frame_width, int frame_height);

/// --camera-mm; `otherwise` is what holds without it.
void add_camera_option(CLI::App& command, double& camera_mm, const std::string& otherwise);
/// The camera's place: above the foot that a board shows, as high as `camera_mm` says; where that
/// is 0, as the board shows in grey levels, or the assumed height.
[[nodiscard]] calibration::CameraView view_of(const PinShift& shift, double camera_mm);

/// Several presses of one ball, and the record of their origin.
struct PressImages {
  calibration::BallPresses set;
  recon::FlatFieldGain gain;  ///< From the lens file.
  calibration::Origin origin;
};

/// Loads the reference images, without presses. Camera and light come from the sensor.toml of a
/// folder in `reference` that has one. Throws like load_images() and choose_map().
[[nodiscard]] PressImages begin_presses(const std::vector<std::string>& reference,
                                        double ball_radius_mm, const MapOptions& map);

/// Adds the images of one press: a PNG file or a folder, FOLDER@MM where the depth was measured.
/// Throws std::runtime_error naming --press, also where the set has these images already.
void add_press(PressImages& images, const std::string& press);

/// The method that turns the darkening of a ball's presses into a LUT.
enum class FitMethod : std::uint8_t {
  automatic,  ///< The best for the presses: calibration::build_auto().
  alone,      ///< The known sphere alone: calibration::build_from_sphere().
  model       ///< A gel fitted to the presses: calibration::build_model().
};
/// By its name on the command line: "auto", "list" or "model".
[[nodiscard]] FitMethod fit_method(const std::string& name);

/// Adds one press: PNG files or folders. Throws like load_images(), and std::runtime_error naming
/// the option when their size differs from the reference's.
void add_press(PressImages& images, const std::vector<std::string>& paths, const char* option);

/// The calibration of one press or several, with its origin. Throws like
/// calibration::build_auto() and build_model().
[[nodiscard]] calibration::Calibration build_lut(const PressImages& images, FitMethod method,
                                                 calibration::PressReport* report);

/// Writes the calibration to `folder` and prints its doubts. Throws std::runtime_error with them
/// and `hint` instead, unless `force`.
void save_or_refuse(const calibration::Calibration& made, const std::vector<std::string>& doubts,
                    bool force, const std::string& folder, const std::string& hint = {});

/// Camera and light of the images in these folders, from a sensor.toml.
[[nodiscard]] calibration::Origin recorded_origin(const std::vector<std::string>& paths);

/// The present time in the format of calibrations.
[[nodiscard]] std::string utc_now();

/// Each press's depth, those left out, and the reason for the gain; lines.
[[nodiscard]] std::string report_text(const calibration::PressReport& report);
/// The LUT's covered range and uncertainty; lines.
[[nodiscard]] std::string lut_text(const recon::Model& model);
/// A description of the gel; lines.
[[nodiscard]] std::string gel_text(const calibration::GelEstimate& gel);

}  // namespace dtact::ctl
