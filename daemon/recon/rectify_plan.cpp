#include "daemon/recon/rectify_plan.hpp"

#include <algorithm>
#include <array>
#include <cstddef>

namespace dtact::recon {
namespace {

using Entry = RectifyTable::Entry;

struct Extent {
  int x0 = INT16_MAX;
  int x1 = 0;
  int y0 = INT16_MAX;
  int y1 = 0;
};

Extent extent_of(std::span<const Entry> group) {
  Extent e;
  for (const Entry& entry : group) {
    e = {std::min<int>(e.x0, entry.x), std::max<int>(e.x1, entry.x), std::min<int>(e.y0, entry.y),
         std::max<int>(e.y1, entry.y)};
  }
  return e;
}

}  // namespace

RectifyPlan::RectifyPlan(const RectifyTable& table)
    : blocks_((table.fine_width() + kBlock - 1) / kBlock) {
  const auto map_blocks =
      static_cast<std::size_t>(blocks_) * static_cast<std::size_t>(table.fine_height());
  head_.reserve(map_blocks);
  data_.reserve(map_blocks * kBlockData);
  const auto width = static_cast<std::size_t>(table.fine_width());
  std::array<Entry, kBlock> block;
  for (int y = 0; y < table.fine_height(); ++y) {
    const auto row = std::span(table.entries).subspan(static_cast<std::size_t>(y) * width, width);
    for (std::size_t x = 0; x < row.size(); x += kBlock) {
      const auto here = row.subspan(x, std::min<std::size_t>(kBlock, row.size() - x));
      std::ranges::copy(here, block.begin());
      std::fill(block.begin() + static_cast<std::ptrdiff_t>(here.size()), block.end(), here.back());
      add(block, table.frame_width, table.frame_height);
    }
  }
  set_stride(table.frame_width);
}

void RectifyPlan::set_stride(std::ptrdiff_t stride) noexcept {
  if (stride == stride_) return;
  stride_ = stride;
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    head_[i / kGroups].at[i % kGroups] =
        static_cast<std::int32_t>(corners_[i].y * stride + corners_[i].x);
  }
}

void RectifyPlan::add(std::span<const Entry> entries, int frame_width, int frame_height) {
  Block head;
  std::array<Extent, kGroups> extents;
  std::array<Corner, kGroups> corners;
  int levels = 1;
  bool near = frame_width >= kBytes;
  for (std::size_t g = 0; g < kGroups; ++g) {
    extents[g] = extent_of(entries.subspan(g * kGroup, kGroup));
    levels = std::max(levels, extents[g].y1 - extents[g].y0 + 1);
    // The right neighbour of the last column must be among the bytes, too.
    near = near && extents[g].x1 - extents[g].x0 <= kBytes - 2;
  }
  near = near && levels <= kMaxLevels && levels < frame_height;
  if (near) {
    head.levels = levels;
    for (std::size_t g = 0; g < kGroups; ++g) {
      // Every group reads `levels` rows and the one below, which must exist.
      corners[g] = {static_cast<std::int16_t>(extents[g].x0),
                    static_cast<std::int16_t>(std::min(extents[g].y0, frame_height - 1 - levels))};
    }
  }
  head_.push_back(head);
  corners_.insert(corners_.end(), corners.begin(), corners.end());
  for (std::size_t i = 0; i < kBlock; ++i) {
    const int column = entries[i].x - corners[i / kGroup].x;
    const int row = entries[i].y - corners[i / kGroup].y;
    data_.push_back(static_cast<std::uint8_t>(near ? row << 4 | column : 0));
  }
  for (const Entry& e : entries) data_.push_back(e.fx);
  for (const Entry& e : entries) data_.push_back(e.fy);
}

}  // namespace dtact::recon
