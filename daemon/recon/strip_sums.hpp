#pragma once

#include <cstdint>

#include "daemon/recon/depth_sums.hpp"
#include "daemon/recon/tiles.hpp"

namespace dtact::recon {

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
