#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/cells.hpp"
#include "daemon/recon/rectify.hpp"
#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

/// When a change counts. Grey levels; one is about 32 µm pressed or 9 µm bulged.
///
/// The frame is compared as means over cells of 16×16 pixels and over every window of 2×2 cells. A
/// change becomes active above `factor` standard deviations of what these means do by themselves
/// from frame to frame, measured while running, but never below the floor nor above the ceiling;
/// it stays active until it is below half of that. What is hidden is therefore a press that is
/// nowhere above the ceilings. With the defaults and sensor_a's noise the floors hold: a wide press
/// hides up to 0.25 levels (8 µm). A spot blurred by the layer (0.3 mm, 8 pixels) hides up to a
/// peak of 0.8 levels (26 µm), wherever it lies between the cells. activity_test.cpp has the proof.
struct ActivitySettings {
  double factor = 5.5;  ///< A false alarm in minutes: some 3000 comparisons a frame.
  double cell_floor = 0.4;
  double cell_ceiling = 0.8;
  double window_floor = 0.25;
  double window_ceiling = 0.5;
  /// The untouched image is followed where nothing is active in or beside a cell; the other cells
  /// go along with the mean of those while they are the majority. At most so many levels a frame
  /// (0.01 levels a second at 60 fps) …
  double drift_per_frame = 0.01 / 60;
  /// … and at most so far from the reference: what a press slower than that can lose.
  double drift_limit = 1.0;
  vec::CellLimits limits;
};

/// What one look at a frame tells, over the part of the frame that the map reads. Levels of grey.
struct ActivityReport {
  double mean_grey = 0;
  double pixel_noise = 0;   ///< Standard deviation of a pixel's noise, from quiet cells.
  double cell_noise = 0;    ///< Of a quiet cell's mean, from frame to frame, slowly averaged.
  double quiet_change = 0;  ///< Frame − untouched image (drift followed), mean of quiet cells.
  double drift = 0;         ///< Mean of what was followed since the reference was set.
  /// The one factor that brings the reference (set_light() included) to this frame, less one, if
  /// `light_alone`: it leaves no cell active, so nothing but the light changed, or all of the field
  /// is pressed alike. Else 0.
  double light_change = 0;
  bool light_alone = false;
  std::int64_t pixels = 0;
  std::int64_t saturated = 0;  ///< Pixels at least as bright as CellLimits::saturated.
  std::int64_t dark = 0;       ///< Pixels at most as bright as CellLimits::dark.
  /// Standard deviation of a pixel's noise, from all cells: steep depth adds a little.
  double rough_noise = 0;
  /// Rows of cells, at the frame's edge or inside, none of which changed by a bit since the frame
  /// before. Noise changes every row: such a row was not exposed anew. Clipped cells do not count.
  int unchanged_rows = 0;
  /// How unevenly the rows of cells changed since the frame before: root mean square of the second
  /// difference, along the columns, of each row's mean change. Bands that wander, not a press.
  double ripple = 0;
  /// The same of half rows of cells: bands too fine for whole ones, down to about twelve pixels.
  double fine_ripple = 0;
  int cells = 0;
  int active_cells = 0;
  int tiles = 0;  ///< Of the depth map.
  int active_tiles = 0;
};

/// Tells which tiles of the depth map changed against the untouched image, by a look at the raw
/// frame that is much cheaper than the reconstruction. Never allocates after construction.
class Activity {
 public:
  /// `radius`: how many pixels of the map a result depends on, on every side. A frame smaller than
  /// a cell is always active.
  Activity(const RectifyTable& table, int radius, const ActivitySettings& settings = {});

  /// The untouched image: frame sized, Q8, row-major without padding. Forgets drift and activity.
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;

  /// The light has changed by a factor since set_reference(); replaces an earlier one.
  void set_light(double factor) noexcept;

  /// Goes on where `other` is, when both look at the same cells.
  void follow(const Activity& other) noexcept;

  /// Looks at a frame. The tiles hold until the next call.
  const TileRows& look(const std::uint8_t* luma, std::ptrdiff_t stride,
                       ActivityReport& report) noexcept;

  [[nodiscard]] const TileGrid& grid() const noexcept { return grid_; }
  /// What look() and the map read of the frame; the rest need not be decoded.
  [[nodiscard]] FrameRegion region() const noexcept;

 private:
  static constexpr double kQ16 = 65536;
  [[nodiscard]] static std::int32_t q16(double levels) noexcept;
  /// Standard deviation over mean magnitude of a Gaussian's difference of two draws: √(π/2)/√2.
  static constexpr double kFromDifference = 0.8862;
  /// Tiles that read a cell, widened by the reach: columns and rows [first, last).
  struct Readers {
    std::int32_t first_column = INT32_MAX;
    std::int32_t last_column = 0;
    std::int32_t first_row = INT32_MAX;
    std::int32_t last_row = 0;
  };
  [[nodiscard]] int x_of(int column) const noexcept;
  [[nodiscard]] int y_of(int row) const noexcept;
  [[nodiscard]] std::size_t at(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(stride_) +
           static_cast<std::size_t>(column);
  }
  void find_readers(const RectifyTable& table, int radius);
  void sum(const std::uint8_t* luma, std::ptrdiff_t stride, vec::CellCounts& counts) noexcept;
  [[nodiscard]] vec::ChangeLimits limits() const noexcept;
  [[nodiscard]] bool touched(int column, int row) const noexcept;
  void mark() noexcept;
  void follow_drift() noexcept;
  /// Fills in what a change of the light alone would be. `all_quiet`: no cell is active, nor was in
  /// the frame before, so that report.quiet_change is the mean of all.
  void compare_light(const vec::ChangeLimits& limits, bool all_quiet,
                     ActivityReport& report) const noexcept;
  /// Fills in what the comparison with the frame before tells.
  void compare_with_before(ActivityReport& report) const noexcept;

  ActivitySettings settings_;
  TileGrid grid_;
  int frame_width_;
  int frame_height_;
  int x_ = 0;  ///< Upper left corner of the cells in the frame.
  int y_ = 0;
  int columns_ = 0;  ///< Of cells; 0: the frame is smaller than one.
  int rows_ = 0;
  int stride_ = 0;  ///< Cells a row of the planes.
  std::vector<Readers> readers_;
  // Planes of cells, as vec::CellPlanes has them; grey levels in Q16. The first plane's values
  // begin at `margin_` where there is one.
  std::size_t margin_ = 0;
  std::vector<std::int32_t> taken_;      ///< The reference as it was set …
  std::vector<std::int32_t> reference_;  ///< … and in the present light.
  std::vector<std::int32_t> drift_;
  std::vector<std::int32_t> expected_;  ///< reference_ + drift_
  std::vector<std::int32_t> sum_;
  std::vector<std::int32_t> sum_before_;
  std::vector<std::int32_t> upper_;  ///< Sums over the upper halves.
  std::vector<std::int32_t> upper_before_;
  std::vector<std::int32_t> rough_;
  std::vector<std::int32_t> change_;
  std::vector<std::int32_t> cell_;
  std::vector<std::int32_t> window_;
  std::vector<std::int32_t> active_;
  TileRows tiles_;
  double noise_ = 0;       ///< Of a cell's mean, levels.
  double mean_drift_ = 0;  ///< Levels.
  double mean_reference_ = 0;
  int active_cells_ = 0;
  std::uint64_t frames_ = 0;  ///< Since the reference was set.
};

}  // namespace dtact::recon
