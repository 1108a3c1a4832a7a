#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "tests/accuracy/chart/scenes.hpp"

namespace dtact::chart {

/// One way to reconstruct.
struct Setting {
  std::string name;           ///< "list full tiles 0.10", unique.
  std::string method;         ///< "published", "list".
  int decimation = 1;         ///< 1, 2 or 4.
  bool tiles = false;         ///< Only what changed.
  double smoothing_mm = 0.1;  ///< Standard deviation; 0: the method's own.
  std::shared_ptr<const recon::Model> model;
};

/// All of them, each calibrated with make_calibration_press() and nothing else.
[[nodiscard]] std::vector<Setting> make_settings(const image::Grey16& reference,
                                                 const Shot& calibration_press);

/// A setting at work on one shot, frame after frame.
class Worker {
 public:
  Worker(const Setting& setting, const image::Grey16& reference, const Shot& shot);
  /// Reconstructs the next of the shot's frames.
  void once();

  struct Error {
    double mean_absolute_mm = 0;  ///< Over judged, trusted pixels and all frames of the shot.
    double untrusted_share = 0;   ///< Of the judged pixels.
  };
  /// Against the truth at every pixel of the crop; a coarser map is read bilinearly.
  [[nodiscard]] Error error();

 private:
  const Setting& setting_;
  const Shot& shot_;
  recon::Reconstructor reconstructor_;
  std::vector<std::vector<std::uint8_t>> frames_;  // padded for vector loads
  std::vector<std::int16_t> depth_um_;
  recon::DrawnTiles drawn_;
  recon::ActivityReport report_;
  std::size_t next_ = 0;
};

}  // namespace dtact::chart
