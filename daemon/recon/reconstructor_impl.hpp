#pragma once

// Inside of the reconstructor.
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "daemon/recon/depth_sums.hpp"
#include "daemon/recon/kernel_lut.hpp"
#include "daemon/recon/lit_reference.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "daemon/recon/sharpener.hpp"
#include "daemon/recon/smoother.hpp"
#include "daemon/recon/tiles.hpp"
#include "daemon/recon/vector_kernels.hpp"

namespace dtact::recon {

/// Pairs of rows that a step works on before the next step: one row of tiles.
inline constexpr int kStrip = Smoother::kStrip;
static_assert(2 * kStrip == TileGrid::kRows);

/// Splits the time of a run into steps. Reads no clock unless the times are requested.
class Stopwatch {
 public:
  explicit Stopwatch(bool on) : on_(on), last_(on ? Clock::now() : Clock::time_point{}) {}
  /// The time since the last call.
  std::int64_t lap() noexcept {
    if (!on_) return 0;
    const auto now = Clock::now();
    return std::chrono::nanoseconds(now - std::exchange(last_, now)).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool on_;
  Clock::time_point last_;
};

/// Makes the rows of a frame: rectified, smoothed and looked up, strip by strip.
struct Reconstructor::Impl {
  Impl(std::shared_ptr<const Model> the_model, int the_steps);

  /// Where row y begins in a depth map.
  [[nodiscard]] std::ptrdiff_t packed(int y) const noexcept {
    return std::ptrdiff_t{y} * grid.width;
  }
  /// `sums` may be null: not requested.
  void apply_lut(const std::uint8_t* luma, const TileRows& tiles, std::int16_t* depth,
                 StripSums* sums, StepTimes& times, Stopwatch& watch) noexcept;
  void clear_rest(const TileRows& tiles, DrawnTiles& drawn, std::int16_t* depth) const noexcept;
  void run_published(const std::uint8_t* luma, std::int16_t* depth, StepTimes& times,
                     Stopwatch& watch) noexcept;

  std::shared_ptr<const Model> model;
  int steps;  ///< of sharpening
  TileGrid grid;
  TileRows all_tiles;
  RectifyPlan plan;
  Smoother smoother;
  Smoother second;  ///< The second filter of the published method.
  RowBuffer in;     ///< A strip before smoothing.
  RowBuffer between;
  RowBuffer out;  ///< A strip after smoothing.
  std::optional<Sharpener> sharpener;
  TileRows sharpener_tiles;  ///< the tiles that it reads
  KernelLut lut;
  LitReference reference;
  int beyond = 0;

 private:
  /// The table's row `y` of fine pixels.
  [[nodiscard]] const RectifyTable::Entry* entries(int y) const noexcept {
    return model->rectify.entries.data() + std::ptrdiff_t{y} * model->rectify.fine_width();
  }
  /// Smooths what `tiles` hold, one row of tiles after the other. Calls begin_row(row), then
  /// made(row, first, last) with each run of its blocks, whose rows lie in `out`, then done(row).
  template <typename Begin, typename Made, typename Done>
  void smooth_tiles(const std::uint8_t* luma, const TileRows& tiles, StepTimes& times,
                    Stopwatch& watch, Begin begin_row, Made made, Done done) noexcept;
  /// The LUT for the blocks [first, last) of a row of tiles. `rows`: levels and gains from the
  /// row's first pixel on.
  void apply_lut_rows(vec::LutRows rows, int row, int first, int last,
                      std::int16_t* depth) noexcept;
  void finish(int row, StripSums* sums, StepTimes& times, Stopwatch& watch) const noexcept;
  /// The smallest area that holds the tiles, and the tiles that hold an area.
  [[nodiscard]] MapArea area_of(const TileRows& tiles) const noexcept;
  void set_tiles(const MapArea& area, TileRows& tiles) const noexcept;
  /// Levels of the rows of tiles, sharpened and looked up.
  void run_sharpened(Sharpener& filter, const std::uint8_t* luma, const TileRows& tiles,
                     std::int16_t* depth, StripSums* sums, StepTimes& times,
                     Stopwatch& watch) noexcept;
  /// The map's pixels [x0, x1) of row `y` before smoothing.
  void rectify(const std::uint8_t* luma, int y, int x0, int x1, std::int16_t* row) noexcept;
  /// Fetches what the last step on a row of tiles reads and writes. Whole maps are fetched by the
  /// processor itself; the short rows of a few tiles are not (5 % of a small press's time).
  void prefetch(const TileRows& tiles, int row, const std::int16_t* depth) const noexcept;
  /// The tiles whose depth needs any row of the pairs [begin, end).
  [[nodiscard]] std::uint64_t readers(const TileRows& tiles, int begin, int end) const noexcept;
  void rectify_pair(const std::uint8_t* luma, int pair, std::uint64_t tiles, int slot) noexcept;
  void push_pair(int pair, std::uint64_t tiles, int slot) noexcept;
  void clear(std::uint64_t tiles, int row, std::int16_t* depth) const noexcept;
};

}  // namespace dtact::recon
