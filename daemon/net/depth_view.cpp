#include "daemon/net/depth_view.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <stdexcept>

#include "daemon/recon/model.hpp"

namespace dtact::net {
namespace {

void require(bool holds, const char* sentence) {
  if (!holds) throw std::invalid_argument(sentence);
}

/// The range along one axis of the map, in pixels of the decimation sent.
struct Extent {
  int begin = 0;
  int end = 0;
  int full = 0;    ///< The whole axis.
  int offset = 0;  ///< Pixels of the frame that are left out before the first block.
};

/// `from` and `size`: pixels of the full resolution, of which the frame has 1/`frame_decimation`
/// and of those the view 1/`factor`.
Extent extent_of(int frame_size, int frame_decimation, int factor, std::int64_t from,
                 std::int64_t size) {
  Extent extent;
  extent.full = frame_size / factor;
  extent.offset = (frame_size - extent.full * factor) / 2;
  // The offset is below a block, so that one block is added and taken off again for whole numbers
  // above 0.
  const auto block_of = [&](std::int64_t frame_pixel) {
    return static_cast<int>(std::clamp<std::int64_t>(
        (frame_pixel - extent.offset + factor) / factor - 1, 0, extent.full));
  };
  extent.begin = block_of(from / frame_decimation);
  extent.end = block_of((from + size + frame_decimation - 1) / frame_decimation + factor - 1);
  return extent;
}

// The loops below have no branches, so that compilers make vectors of them.

/// Micrometres to units, rounded half away from zero; `um` known, so that no division is left.
template <int um>
void scale_row(const std::int16_t* row, std::size_t width, std::int16_t* out) noexcept {
  for (std::size_t x = 0; x < width; ++x) {
    const std::int16_t value = row[x];
    // Modulo 65536, where even the untrusted value has its magnitude.
    const auto magnitude = static_cast<std::uint16_t>(value < 0 ? 0 - value : value);
    const auto quotient =
        static_cast<std::int16_t>(static_cast<std::uint16_t>(magnitude + um / 2) / um);
    const auto scaled = static_cast<std::int16_t>(value < 0 ? -quotient : quotient);
    out[x] = value == recon::kUntrusted ? value : scaled;
  }
}

/// Adds a row of trusted pixels to the columns' sums and counts.
void add_row(const std::int16_t* row, std::size_t columns, std::int32_t* sums,
             std::int32_t* counts) noexcept {
  for (std::size_t x = 0; x < columns; ++x) {
    const std::int32_t value = row[x];
    const std::int32_t trusted = value != recon::kUntrusted ? 1 : 0;
    sums[x] += value & -trusted;
    counts[x] += trusted;
  }
}

/// sum / divisor, rounded half away from zero. Exact: 2 |sum| + divisor stays below 2²². A
/// quotient of two of these numbers that is not whole lies further below the next whole one than a
/// float's rounding reaches.
std::int32_t rounded(std::int32_t sum, std::int32_t divisor) noexcept {
  const auto quotient = static_cast<std::int32_t>(static_cast<float>(2 * std::abs(sum) + divisor) /
                                                  static_cast<float>(2 * divisor));
  return sum < 0 ? -quotient : quotient;
}

/// Each `factor` columns to one value. No value can be that of untrusted pixels: a mean lies
/// between the trusted ones, and a rounded share of it not further from 0.
template <std::size_t factor>
void finish_row(const std::int32_t* sums, const std::int32_t* counts, std::size_t width,
                int um_per_unit, std::int16_t* out) noexcept {
  for (std::size_t x = 0; x < width; ++x) {
    std::int32_t sum = 0;
    std::int32_t count = 0;
    for (std::size_t i = 0; i < factor; ++i) {
      sum += sums[x * factor + i];
      count += counts[x * factor + i];
    }
    const std::int32_t value = rounded(sum, std::max(count, 1) * um_per_unit);
    const bool trusted = 2 * count > static_cast<std::int32_t>(factor * factor);
    out[x] = static_cast<std::int16_t>(trusted ? value : recon::kUntrusted);
  }
}

void scale(const std::int16_t* row, std::size_t width, int um_per_unit,
           std::int16_t* out) noexcept {
  switch (um_per_unit) {
    case 1:
      std::copy_n(row, width, out);
      break;
    case 2:
      scale_row<2>(row, width, out);
      break;
    case 5:
      scale_row<5>(row, width, out);
      break;
    default:
      scale_row<10>(row, width, out);
      break;
  }
}

}  // namespace

void DepthViewer::average(const std::int16_t* rows, std::size_t stride, std::size_t width,
                          int factor, int um_per_unit, std::int16_t* out) {
  const std::size_t columns = width * static_cast<std::size_t>(factor);
  sums_.assign(columns, 0);
  counts_.assign(columns, 0);
  for (int k = 0; k < factor; ++k, rows += stride) {
    add_row(rows, columns, sums_.data(), counts_.data());
  }
  const auto finish = factor == 2 ? finish_row<2> : finish_row<4>;
  finish(sums_.data(), counts_.data(), width, um_per_unit, out);
}

std::optional<DepthView> DepthViewer::view(const pipeline::DepthFrame& frame,
                                           const DepthSpec& spec) {
  require(spec.decimation == 1 || spec.decimation == 2 || spec.decimation == 4,
          "depth map: the decimation must be 1, 2 or 4");
  require(spec.um_per_unit == 1 || spec.um_per_unit == 2 || spec.um_per_unit == 5 ||
              spec.um_per_unit == 10,
          "depth map: the unit must be 1, 2, 5 or 10 um");
  const int factor = std::max(1, spec.decimation / frame.decimation);
  constexpr DepthRegion kWhole{0, 0, UINT32_MAX, UINT32_MAX};
  const DepthRegion region = spec.region.value_or(kWhole);
  const auto columns = extent_of(frame.width, frame.decimation, factor, region.x, region.width);
  const auto rows = extent_of(frame.height, frame.decimation, factor, region.y, region.height);
  DepthView view;
  view.x = columns.begin;
  view.y = rows.begin;
  view.width = columns.end - columns.begin;
  view.height = rows.end - rows.begin;
  view.full_width = columns.full;
  view.full_height = rows.full;
  view.decimation = frame.decimation * factor;
  view.mm_per_px = frame.mm_per_px * factor;
  view.um_per_unit = spec.um_per_unit;
  if (view.width <= 0 || view.height <= 0) return std::nullopt;

  const auto stride = static_cast<std::size_t>(frame.width);
  const auto width = static_cast<std::size_t>(view.width);
  const auto height = static_cast<std::size_t>(view.height);
  const std::int16_t* from = frame.depth_um.data() +
                             static_cast<std::size_t>(rows.begin * factor + rows.offset) * stride +
                             static_cast<std::size_t>(columns.begin * factor + columns.offset);
  if (factor == 1 && spec.um_per_unit == 1 && width == stride) {
    view.values = {from, width * height};
    return view;
  }
  values_.resize(width * height);
  for (std::size_t y = 0; y < height; ++y, from += stride * static_cast<std::size_t>(factor)) {
    std::int16_t* const to = values_.data() + y * width;
    if (factor == 1) {
      scale(from, width, spec.um_per_unit, to);
    } else {
      average(from, stride, width, factor, spec.um_per_unit, to);
    }
  }
  view.values = values_;
  return view;
}

}  // namespace dtact::net
