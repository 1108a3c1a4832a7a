#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/pipeline/reference/cells.hpp"
#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "tests/accuracy/chart/scenes.hpp"

namespace dtact::chart {

/// One way to reconstruct.
struct Setting {
  std::string name;  ///< "list full tiles 0.10", unique.
  /// "published", "regression", "list", "several", "ours", "virtual balls", "MJPEG".
  std::string method;
  int decimation = 1;         ///< 1, 2 or 4.
  bool tiles = false;         ///< Only the active tiles.
  double smoothing_mm = 0.1;  ///< Standard deviation; 0: the method's own.
  std::shared_ptr<const recon::Model> model;
  int steps = 0;  ///< Sharpening steps.
  /// 1, 2 or 4: frames are JPEGs, decoded at 1/decode_scale of their size as part of the work; the
  /// reference is the mean of such frames. 0: frames are luma.
  int decode_scale = 0;
};

/// All settings, calibrated with make_calibration_press(); "regression" and "several" with
/// make_calibration_presses(); "virtual balls" as with_luts_of_virtual_balls() says. "list" and
/// "several" use the known sphere only, "ours" is dtact-calibrate's default for the one
/// press.
[[nodiscard]] std::vector<Setting> make_settings(const image::Grey16& reference);

/// The reference as a daemon takes it: of luma `reference` as it is; of JPEGs the mean of 32 frames
/// that are decoded as the setting's.
[[nodiscard]] image::Grey16 reference_for(const Setting& setting, const image::Grey16& reference);

struct Error {
  double mean_absolute_mm = 0;  ///< Over judged, trusted pixels.
  double untrusted_share = 0;   ///< Share of the judged pixels.
};

/// The presses of a 4 mm ball from which the LUT of "several" is made.
[[nodiscard]] calibration::BallPresses several_presses(const image::Grey16& reference);

/// Error of one map at 1/decimation of the crop's resolution against the truth at every pixel of
/// the crop: a coarser map is read bilinearly.
[[nodiscard]] Error error_of(const std::vector<std::int16_t>& depth_um, int decimation,
                             const Shot& shot);

/// The shot's frames as the simulated camera sends them.
class JpegShot {
 public:
  JpegShot(const std::vector<image::Grey8>& frames, int decode_scale);
  /// What of the decoded frames is read.
  void set_crop(const recon::FrameRegion& crop) noexcept;
  [[nodiscard]] hal::LumaView decode(std::size_t frame);

 private:
  std::vector<std::vector<std::uint8_t>> payloads_;
  hal::mjpeg::GreyDecoder decoder_;
  hal::luma::LumaBuffer luma_;
};

/// Runs a setting on one shot, frame after frame.
class Worker {
 public:
  /// `reference`: of the frames as the setting has them (reference_for()).
  Worker(const Setting& setting, const image::Grey16& reference, const Shot& shot);
  /// Reconstructs the next of the shot's frames.
  void once();

  /// The mean over all frames of the shot.
  [[nodiscard]] Error error();

 private:
  const Setting& setting_;
  const Shot& shot_;
  recon::Reconstructor reconstructor_;
  pipeline::Cells cells_;
  recon::TileReaders readers_;
  recon::TileRows tiles_;
  std::vector<std::vector<std::uint8_t>> frames_;  // padded for vector loads; none of JPEGs
  std::optional<JpegShot> jpegs_;
  std::vector<std::int16_t> depth_um_;
  recon::DrawnTiles drawn_;
  std::size_t next_ = 0;
};

}  // namespace dtact::chart
