#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "clients/calibrate/fit/contact.hpp"
#include "clients/calibrate/guided/capture.hpp"
#include "clients/calibrate/guided/work_folder.hpp"
#include "daemon/calibration/calibration.hpp"

namespace dtact::ctl::guided {

/// Shows frames: to a person who watches, if any, and as preview.png in the work
/// folder.
class LiveView {
 public:
  /// `presses_required`: number of presses for the calibration.
  LiveView(Console& console, WorkFolder& folder, int presses_required)
      : console_(console), folder_(folder) {
    scene_.presses_required = presses_required;
  }

  /// The depth map's position and, once taken, the reference's image and cells (empty before).
  /// `cell_mm`: side of a look's cells.
  void use(const calibration::Calibration& empty, CellMeans reference, double cell_mm);
  /// The question under the live picture, drawn at once, even while no frame comes.
  void set_prompt(const Prompt& prompt);
  /// The presses so far, and the depth that their LUT covers (0: no LUT).
  void set_presses(std::vector<CapturedPress> presses, double covered_mm);

  /// Draws at most four times a second of the frames' time, and saves once a second; only where a
  /// person watches.
  void show(const ObservedFrame& look, const std::string& words);
  /// Saves one frame, with the contact where it is known, and draws it to stay when it is in
  /// contact.
  void still(const image::Grey8& frame, const std::optional<calibration::Contact>& contact,
             bool in_contact = true);

 private:
  [[nodiscard]] image::Grey8 picture(const image::Grey8& frame) const;
  [[nodiscard]] std::string words_on(const ObservedFrame& look, const std::string& words) const;

  Console& console_;
  WorkFolder& folder_;
  std::shared_ptr<const recon::Model> model_;
  std::optional<image::Grey8> reference_;
  CellMeans reference_cells_;
  Scene scene_;  ///< Without the picture.
  double cell_mm_ = 0;
  std::int64_t drawn_ns_ = 0;
  std::int64_t saved_ns_ = 0;
};

}  // namespace dtact::ctl::guided
