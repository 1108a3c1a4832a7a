#include "daemon/recon/rectify.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace dtact::recon {

RectifyTable make_crop_table(int frame_width, int frame_height, int crop_col, int crop_row,
                             int width, int height) {
  if (frame_width < 2 || frame_height < 2 || frame_width > INT16_MAX || frame_height > INT16_MAX) {
    throw std::invalid_argument("crop: the frame must be 2 to 32767 pixels wide and high");
  }
  if (width < 1 || height < 1 || crop_col < 0 || crop_row < 0 || width > frame_width - crop_col ||
      height > frame_height - crop_row) {
    throw std::invalid_argument("crop: " + std::to_string(width) + "x" + std::to_string(height) +
                                " at column " + std::to_string(crop_col) + ", row " +
                                std::to_string(crop_row) + " leaves the frame of " +
                                std::to_string(frame_width) + "x" + std::to_string(frame_height));
  }
  RectifyTable table{frame_width, frame_height, width, height, {}};
  table.entries.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = crop_row; y < crop_row + height; ++y) {
    for (int x = crop_col; x < crop_col + width; ++x) {
      // The last column and row are reached from the one before with the full weight.
      const int left = std::min(x, frame_width - 2);
      const int upper = std::min(y, frame_height - 2);
      table.entries.push_back({static_cast<std::int16_t>(left), static_cast<std::int16_t>(upper),
                               static_cast<std::uint8_t>(x == left ? 0 : 128),
                               static_cast<std::uint8_t>(y == upper ? 0 : 128)});
    }
  }
  return table;
}

FrameRegion region_read(const RectifyTable& table) noexcept {
  int left = table.frame_width;
  int right = 0;
  int top = table.frame_height;
  int bottom = 0;
  for (const RectifyTable::Entry& entry : table.entries) {
    left = std::min<int>(left, entry.x);
    right = std::max(right, entry.x + 2);
    top = std::min<int>(top, entry.y);
    bottom = std::max(bottom, entry.y + 2);
  }
  return {left, top, right - left, bottom - top};
}

}  // namespace dtact::recon
