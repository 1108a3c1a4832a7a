#pragma once

#include <cstdint>
#include <vector>

#include "daemon/recon/rectify.hpp"

namespace dtact::ctl::guided {

/// Mean grey of square cells, row by row. A cell of 12 × 12 pixels takes a pixel's noise to a
/// twelfth, and a ball's contact is several cells wide.
using CellMeans = std::vector<float>;

/// The part of the frame that the depth map shows, divided into cells.
class CellGrid {
 public:
  CellGrid() = default;
  /// About 48 cells along the shorter side, none below 12 pixels. Throws std::invalid_argument
  /// where that is less than 8 cells.
  explicit CellGrid(const recon::FrameRegion& region);

  /// Means of a frame of 8-bit luma, `width` pixels a row, without padding.
  [[nodiscard]] CellMeans of(const std::vector<std::uint8_t>& luma, int width) const;
  /// The same of Q8 luma.
  [[nodiscard]] CellMeans of(const std::vector<std::uint16_t>& luma_q8, int width) const;

  [[nodiscard]] int cell_px() const noexcept { return cell_; }

 private:
  template <typename Pixel>
  [[nodiscard]] CellMeans means(const std::vector<Pixel>& pixels, int width, double scale) const;

  recon::FrameRegion region_;
  int cell_ = 1;
};

/// What a frame shows against the undeformed surface, grey levels.
struct ContactEvidence {
  double darkest = 0;     ///< Darkest cell, less the light's change.
  double brightest = 0;   ///< The same the other way.
  double light = 0;       ///< By how much most cells became darker: the light changed.
  double dark_cells = 0;  ///< Those darker by kEdgeLevels.
};
/// The edge of a contact, as find_contact() has it.
inline constexpr double kEdgeLevels = 3;
/// The faintest darkening that counts as touch, grey levels (about 0.12 mm). A cell's noise is 0.1.
inline constexpr double kContactLevels = 4;

[[nodiscard]] ContactEvidence compare(const CellMeans& reference, const CellMeans& now);
/// There was contact when the reference was taken and does not now: the surface is brighter there.
/// The bulge round a contact is brighter too, but by less than the contact is darker (0.35 and 0.71
/// of it on two real sensors).
[[nodiscard]] bool reference_in_contact(const ContactEvidence& seen);
/// The largest difference of two cells at one place, grey levels.
[[nodiscard]] double largest_change(const CellMeans& a, const CellMeans& b);

/// Counts the frames in a row that look alike.
class Steadiness {
 public:
  /// `tolerance`: grey levels that a cell may differ from the first frame of the row.
  explicit Steadiness(double tolerance) : tolerance_(tolerance) {}
  /// The frames in a row so far, this one included.
  int add(const CellMeans& cells);
  /// The change that broke the last row, grey levels; 0 when none was broken.
  [[nodiscard]] double broke_at() const noexcept { return broke_at_; }
  void restart() noexcept { row_ = 0; }

 private:
  double tolerance_;
  CellMeans first_;
  int row_ = 0;
  double broke_at_ = 0;
};

}  // namespace dtact::ctl::guided
