#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/serve/frame_kind.hpp"

namespace dtact::net {

/// The map as dtact.v1.DepthMap says it.
struct DepthView {
  int x = 0;  ///< First column, in pixels of this decimation; so are all sizes.
  int y = 0;
  int width = 0;
  int height = 0;
  int full_width = 0;
  int full_height = 0;
  int decimation = 1;
  double mm_per_px = 0;
  int um_per_unit = 1;
  std::span<const std::int16_t> values;  ///< Row-major; recon::kUntrusted marks untrusted pixels.
};

/// Makes the maps that were asked for out of the frame's one. Nothing is copied when a frame's rows
/// can be sent as they are, and the buffers are used again.
class DepthViewer {
 public:
  /// A frame that is coarser than requested is not refined. Coarser pixels are means over trusted
  /// pixels of their block, untrusted when at least half of it is. Columns and rows that fill no
  /// block are left out on both sides alike, as in recon::decimate. The only rounding, to units,
  /// is half away from zero. A frame that was made coarse does not record which columns were left
  /// out, so a region in it may be off by one pixel of full resolution.
  ///
  /// Empty when the region lies outside the map, or the map has no whole block. The values are
  /// valid until the next call and while the frame is unchanged. Throws std::invalid_argument for
  /// another decimation or unit.
  [[nodiscard]] std::optional<DepthView> view(const pipeline::DepthFrame& frame,
                                              const DepthSpec& spec);

 private:
  /// `factor` rows to one of `width` values.
  void average(const std::int16_t* rows, std::size_t stride, std::size_t width, int factor,
               int um_per_unit, std::int16_t* out);

  std::vector<std::int16_t> values_;
  std::vector<std::int32_t> sums_;    ///< A column each, over the rows of a block.
  std::vector<std::int32_t> counts_;  ///< counts of trusted pixels
};

}  // namespace dtact::net
