#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/pipeline/reference/cell_sums.hpp"
#include "daemon/recon/cells.hpp"
#include "daemon/recon/tile_readers.hpp"
#include "hal/frame.hpp"

namespace dtact::pipeline {

/// When a change counts. Grey levels; one is about 32 µm pressed or 9 µm bulged.
///
/// The frame is compared as means over cells of 16×16 pixels and over every window of 2×2 cells. A
/// change becomes active above `factor` standard deviations of the frame-to-frame noise of these
/// means, measured while running, but never below the floor nor above the ceiling.
/// It stays active until it is below half of that. So only a press that is nowhere above the
/// ceilings stays hidden. With the defaults and sensor_a's noise the floors hold: a wide press
/// hides up to 0.25 levels (8 µm). A spot blurred by the gel (0.3 mm, 8 pixels) hides up to a
/// peak of 0.8 levels (26 µm), wherever it lies between the cells. Shown by cells_test.cpp.
struct CellSettings {
  double factor = 5.5;  ///< A false alarm in minutes: some 3000 comparisons a frame.
  double cell_floor = 0.4;
  double cell_ceiling = 0.8;
  double window_floor = 0.25;
  double window_ceiling = 0.5;
  /// Drift of the reference image is followed where no cell nearby is active. The other cells
  /// follow the mean of those while they are the majority. Limit in levels per frame
  /// (0.01 levels a second at 60 fps) …
  double drift_per_frame = 0.01 / 60;
  /// … and at most so far from the reference: what a press slower than that can lose.
  double drift_limit = 1.0;
  CellLimits limits;
};

/// The light seen in a frame, as one factor on the reference image.
struct LightSeen {
  enum class From : std::uint8_t {
    nothing,  ///< Not seen in this frame.
    quiet,    ///< From the cells without contact, during contact others.
    all       ///< It explains every cell: only the light changed, or all of the field is pressed
              ///< alike.
  };
  From from = From::nothing;
  /// The one factor that brings the reference, set_light() included, to this frame, less one.
  double change = 0;
};

/// Result of comparing one frame. Grey levels.
struct CellReport {
  double mean_grey = 0;
  double cell_noise = 0;    ///< Frame-to-frame noise of a quiet cell's mean, slowly averaged.
  double quiet_change = 0;  ///< Frame − reference image (drift followed), mean of quiet cells.
  double drift = 0;         ///< Mean of what was followed since the reference was set.
  LightSeen light;
  FrameStatistics frame;
  int cells = 0;  ///< 0: the frame is smaller than one, and nothing of this is known.
  int active_cells = 0;
};

/// The reference image in the present light, as means over cells: reference × light + drift. Finds
/// where a frame differs from it, much more cheaply than a reconstruction. Does not allocate
/// after construction.
class Cells {
 public:
  explicit Cells(const recon::CellLattice& lattice, const CellSettings& settings = {});

  /// The reference image: frame sized, Q8, row-major without padding. Forgets drift and activity.
  void set_reference(std::span<const std::uint16_t> reference_q8) noexcept;

  /// The light has changed by a factor since set_reference(); replaces an earlier one. What drift
  /// had followed of the same change is taken off it.
  void set_light(double factor) noexcept;

  /// Looks at the next frame.
  CellReport look(const hal::LumaView& luma) noexcept;

  /// A plane of the lattice's cells: not 0 where the last frame differs from the reference image.
  [[nodiscard]] std::span<const std::int32_t> active() const noexcept {
    return std::span(active_).subspan(margin_);
  }
  [[nodiscard]] const recon::CellLattice& lattice() const noexcept { return lattice_; }

  /// Every kFollowEvery-th frame follows drift and looks for the light among cells in contact.
  static constexpr int kFollowEvery = 16;

 private:
  [[nodiscard]] recon::vec::ChangeLimits limits() const noexcept;
  [[nodiscard]] bool in_contact(int column, int row) const noexcept;
  void follow_drift() noexcept;
  void forget_drift() noexcept;
  void set_drift(std::size_t i, double q16) noexcept;
  /// `all_quiet`: no cell is active, nor was in the frame before, so that `quiet_change` is the
  /// mean of all.
  [[nodiscard]] LightSeen see_light(std::int32_t most, bool all_quiet,
                                    double quiet_change) noexcept;
  [[nodiscard]] LightSeen from_all(std::int32_t most) const noexcept;
  [[nodiscard]] LightSeen from_quiet() noexcept;

  recon::CellLattice lattice_;
  CellSettings settings_;
  CellSums sums_;
  // Planes of cells, as vec::CellPlanes has them; grey levels in Q16. The values of the last three
  // begin at `margin_`.
  std::size_t margin_;
  std::vector<std::int32_t> taken_;      // the reference as it was set …
  std::vector<std::int32_t> reference_;  // … and in the present light
  std::vector<std::int32_t> drift_;
  std::vector<std::int32_t> expected_;  // reference_ + drift_
  std::vector<std::int32_t> cell_;
  std::vector<std::int32_t> change_;
  std::vector<std::int32_t> window_;
  std::vector<std::int32_t> active_;
  std::vector<float> shares_;  // scratch
  double noise_ = 0;           // of a cell's mean, levels
  double mean_drift_ = 0;      // levels
  double mean_reference_ = 0;
  int active_cells_ = 0;
};

}  // namespace dtact::pipeline
