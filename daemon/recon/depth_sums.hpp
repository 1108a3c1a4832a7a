#pragma once

#include <cstdint>

#include "daemon/recon/model.hpp"
#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

/// What is to be added up while a map is made. What a contact is, the caller knows. Thresholds in
/// micrometres, above kUntrusted.
struct SumRules {
  std::int16_t threshold_um = 0;  ///< Deeper pixels are summed.
  std::int16_t release_um = 0;    ///< Deeper pixels are counted, too.
  /// Distance in pixels of the second difference's neighbours; 0: the bend is not needed.
  int bend_reach = 0;
  std::int16_t bend_from_um = 0;  ///< Deeper pixels count for the bend.

  /// Step between the rows used for the bend: the distance of its neighbours, at most four.
  [[nodiscard]] constexpr int bend_step() const noexcept {
    return bend_reach < kMaxRows ? bend_reach : kMaxRows;
  }

 private:
  static constexpr int kMaxRows = 4;
};

/// What the pixels of one map add up to, in pixels and micrometres. Untrusted pixels count for
/// nothing. Depth within ±16383 (recon::check).
struct DepthSums {
  explicit DepthSums(const SumRules& the_rules) noexcept : rules(the_rules) {}

  SumRules rules;
  std::int64_t made = 0;  ///< Pixels deeper than rules.threshold_um, …
  std::int64_t um = 0;    ///< … the sum of their depth, and of depth times column and row.
  std::int64_t um_x = 0;
  std::int64_t um_y = 0;
  /// The squared depths of those in even rows, in units of kSquareUm2, each rounded, and times
  /// column and row: half of the rows is enough for a small correction and costs half of the time.
  std::int64_t square = 0;
  std::int64_t square_x = 0;
  std::int64_t square_y = 0;
  static constexpr double kSquareUm2 = 8192;
  std::int64_t lost = 0;                 ///< Pixels deeper than rules.release_um.
  std::int16_t deepest_um = kUntrusted;  ///< kUntrusted: no trusted pixel was looked at.
  int deepest_x = 0;                     ///< The first of the deepest in row-major order.
  int deepest_y = 0;
  /// Pixels deeper than rules.bend_from_um, all four neighbours in the map and trusted, of rows
  /// bend_reach + n · bend_step …
  std::int64_t bent = 0;
  /// … and their sum of |four neighbours − 4 × pixel|, of which no pixel adds more than 32767: the
  /// sums of two opposite neighbours and the sum of those two are int16, saturated.
  std::int64_t bend_um = 0;
};

/// Adds a map up while it is made, one row of tiles after the other: what was just written is still
/// in the cache. Only the tiles of `tiles` are looked at; the bend's neighbours may lie in others.
/// Refers to what it is given.
class StripSums {
 public:
  StripSums(const TileGrid& grid, const TileRows& tiles, const std::int16_t* depth_um,
            DepthSums& sums) noexcept
      : grid_(grid),
        tiles_(tiles),
        depth_um_(depth_um),
        sums_(sums),
        bend_y_(sums.rules.bend_reach) {}

  /// Every pixel down to the end of this row of tiles is what it will be. Rows come in order, all
  /// of them.
  void finished(int row) noexcept;

 private:
  void bend(int y) noexcept;

  const TileGrid& grid_;
  const TileRows& tiles_;
  const std::int16_t* depth_um_;
  DepthSums& sums_;
  int bend_y_;  ///< The next row that is looked at for the bend.
};

}  // namespace dtact::recon
