#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "daemon/recon/cells.hpp"
#include "daemon/recon/tile_readers.hpp"

namespace dtact::pipeline {

/// Standard deviation over mean magnitude of a Gaussian's difference of two draws: √(π/2)/√2.
inline constexpr double kFromDifference = 0.8862;

/// Grey levels at which a pixel is clipped.
struct CellLimits {
  std::uint8_t saturated = 250;  ///< From here on.
  std::uint8_t dark = 5;         ///< Up to here.
};

/// Statistics of a frame, alone and against the previous one, over the part that the map reads.
/// Grey levels.
struct FrameStatistics {
  std::int64_t pixels = 0;
  std::int64_t saturated = 0;  ///< Pixels at least as bright as CellLimits::saturated.
  /// Standard deviation of a pixel's noise, from all cells: steep depth adds a little.
  double rough_noise = 0;
  /// Rows of cells, at the frame's edge or inside, that equal the previous frame's bit for bit.
  /// Noise changes every row: an equal row was not exposed anew. Clipped cells do not count.
  int unchanged_rows = 0;
  /// How unevenly rows of cells changed since the previous frame: root mean square of the second
  /// difference, along the columns, of each row's mean change. High for moving bands, not a press.
  double ripple = 0;
  /// The same of half rows of cells: bands too fine for whole ones, down to about twelve pixels.
  double fine_ripple = 0;
};

/// The newest frame and the one before as sums over cells. Never allocates after construction.
class CellSums {
 public:
  CellSums(const recon::CellLattice& lattice, const CellLimits& limits);

  /// Sums the next frame; a lattice without cells sums nothing.
  void add(const std::uint8_t* luma, std::ptrdiff_t stride) noexcept;
  /// What compares with the frame before is 0 for the first frame.
  [[nodiscard]] FrameStatistics statistics() const noexcept;

  // Planes of the lattice's cells (recon::vec::sum_cells).
  [[nodiscard]] const std::int32_t* now() const noexcept { return sum_.data(); }
  [[nodiscard]] const std::int32_t* before() const noexcept { return sum_before_.data(); }
  /// Frames added.
  [[nodiscard]] std::uint64_t frames() const noexcept { return frames_; }
  /// The next frame has none before.
  void restart() noexcept { frames_ = 0; }

 private:
  recon::CellLattice lattice_;
  CellLimits limits_;
  std::vector<std::int32_t> sum_;
  std::vector<std::int32_t> sum_before_;
  std::vector<std::int32_t> upper_;  // sums over the upper halves
  std::vector<std::int32_t> upper_before_;
  std::vector<std::int32_t> rough_;
  std::int64_t saturated_ = 0;  // pixels of the newest
  std::uint64_t frames_ = 0;
};

}  // namespace dtact::pipeline
