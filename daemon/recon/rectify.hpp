#pragma once

#include <cstdint>
#include <vector>

namespace dtact::recon {

/// Pixels of the largest depth map: with 16 bits each they fill a message.
inline constexpr std::int64_t kMaxMapPixels = std::int64_t{1} << 23U;

/// For every pixel of the depth map, where it is read in the camera frame. Bilinear with weights of
/// 1/128; identity and crop are tables like any other. All four source pixels of an entry lie in
/// the frame: its last column and row are reached from the one before with weight 128.
struct RectifyTable {
  int frame_width = 0;   ///< Pixels of the camera frame.
  int frame_height = 0;  ///< Pixels of the camera frame.
  int width = 0;         ///< Pixels of the depth map.
  int height = 0;        ///< Pixels of the depth map.
  struct Entry {
    std::int16_t x = 0;   ///< Column of the upper left source pixel, 0 … frame_width − 2.
    std::int16_t y = 0;   ///< Row of the upper left source pixel, 0 … frame_height − 2.
    std::uint8_t fx = 0;  ///< Weight of the right column, 0 … 128.
    std::uint8_t fy = 0;  ///< Weight of the lower row, 0 … 128.
  };
  /// Row-major, (width · decimation) × (height · decimation).
  std::vector<Entry> entries;
  /// 1, 2 or 4: a pixel of the map is the mean of decimation × decimation entries. So a coarse
  /// map is a fine one averaged over areas and nothing aliases, whatever the lens does.
  int decimation = 1;

  [[nodiscard]] int fine_width() const noexcept { return width * decimation; }
  [[nodiscard]] int fine_height() const noexcept { return height * decimation; }
};

/// A rectangle of the camera frame, pixels.
struct FrameRegion {
  int x = 0;
  int y = 0;
  int width = 0;
  int height = 0;
};

/// The table that copies the rectangle whose upper left corner is (crop_col, crop_row). Throws
/// std::invalid_argument when the rectangle leaves the frame.
[[nodiscard]] RectifyTable make_crop_table(int frame_width, int frame_height, int crop_col,
                                           int crop_row, int width, int height);

/// The smallest rectangle with every pixel that the table reads. The table has entries.
[[nodiscard]] FrameRegion region_read(const RectifyTable& table) noexcept;

}  // namespace dtact::recon
