#pragma once

#include <cstdint>
#include <vector>

#include "daemon/recon/rectify.hpp"

namespace dtact::ctl::guided {

/// Mean grey of square cells, row by row. A cell of 12 × 12 pixels reduces a pixel's noise to a
/// twelfth, and a ball's contact is several cells wide.
using CellMeans = std::vector<float>;

/// The part of the frame that the depth map shows, divided into cells.
class CellGrid {
 public:
  CellGrid() = default;
  /// About 48 cells along the shorter side, each at least 12 pixels. Throws std::invalid_argument
  /// with less than 8 cells.
  explicit CellGrid(const recon::FrameRegion& region);

  /// Means of a frame of 8-bit luma, `width` pixels a row, without padding.
  [[nodiscard]] CellMeans of(const std::vector<std::uint8_t>& luma, int width) const;
  /// The same for Q8 luma.
  [[nodiscard]] CellMeans of(const std::vector<std::uint16_t>& luma_q8, int width) const;

  [[nodiscard]] int cell_px() const noexcept { return cell_; }

 private:
  template <typename Pixel>
  [[nodiscard]] CellMeans means(const std::vector<Pixel>& pixels, int width, double scale) const;

  recon::FrameRegion region_;
  int cell_ = 1;
};

/// Differences of a frame from the undeformed surface, grey levels.
struct ContactEvidence {
  double darkest = 0;     ///< Darkening of the darkest cell, without the light's change.
  double brightest = 0;   ///< Brightening of the brightest cell.
  double light = 0;       ///< Darkening of most cells: the light changed.
  double dark_cells = 0;  ///< Number of cells darker by kEdgeLevels.
};
/// The edge of a contact, as in find_contact().
inline constexpr double kEdgeLevels = 3;
/// The faintest darkening that counts as contact, grey levels (about 0.12 mm). A cell's noise is
/// 0.1.
inline constexpr double kContactLevels = 4;

[[nodiscard]] ContactEvidence compare(const CellMeans& reference, const CellMeans& now);
/// Whether there was contact when the reference was taken and is none now: the surface is brighter.
/// The bulge around a contact is brighter too, but by less than the contact is darker (0.35 and
/// 0.71 of it on two real sensors).
[[nodiscard]] bool reference_in_contact(const ContactEvidence& seen);
/// The largest difference of two corresponding cells, grey levels.
[[nodiscard]] double largest_change(const CellMeans& a, const CellMeans& b);

/// Counts consecutive frames that look alike.
class Steadiness {
 public:
  /// `tolerance`: grey levels by which a cell may differ from the first frame of the row.
  explicit Steadiness(double tolerance) : tolerance_(tolerance) {}
  /// Number of consecutive frames, including this one.
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
