#pragma once

#include <memory>
#include <string>
#include <vector>

#include "clients/calibrate/fit/press_set.hpp"
#include "daemon/pipeline/reference/cells.hpp"
#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "tests/accuracy/chart/scenes.hpp"

namespace dtact::chart {

/// One way to reconstruct.
struct Setting {
  std::string name;    ///< "list full tiles 0.10", unique.
  std::string method;  ///< "published", "regression", "list", "several", "ours", "virtual balls".
  int decimation = 1;  ///< 1, 2 or 4.
  bool tiles = false;  ///< Only the active tiles.
  double smoothing_mm = 0.1;  ///< Standard deviation; 0: the method's own.
  std::shared_ptr<const recon::Model> model;
  int steps = 0;  ///< Sharpening steps.
};

/// All settings, calibrated with make_calibration_press(); "regression" and "several" with
/// make_calibration_presses(); "virtual balls" as with_luts_of_virtual_balls() says. "list" and
/// "several" use the known sphere only, "ours" is dtact-calibrate's default for the one
/// press.
[[nodiscard]] std::vector<Setting> make_settings(const image::Grey16& reference);

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

/// Runs a setting on one shot, frame after frame.
class Worker {
 public:
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
  std::vector<std::vector<std::uint8_t>> frames_;  // padded for vector loads
  std::vector<std::int16_t> depth_um_;
  recon::DrawnTiles drawn_;
  std::size_t next_ = 0;
};

}  // namespace dtact::chart
