#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/rectify.hpp"

namespace dtact::recon {

/// A rectification table in the layout that the vector kernel reads. Neighbouring pixels of the map
/// are close together in the frame, so eight of them (a group) find all their bytes in 16-byte
/// pieces of a few frame rows. One load per row and a shuffle within the register replace the
/// gather. Identity, crop and lens differ only in the number of rows that a group needs.
class RectifyPlan {
 public:
  static constexpr int kGroup = 8;               ///< Pixels whose bytes one load a row holds.
  static constexpr int kGroups = 4;              ///< Groups in a block.
  static constexpr int kBlock = 32;              ///< Pixels of a block.
  static constexpr int kBytes = 16;              ///< Frame bytes a group reads from one row.
  static constexpr int kMaxLevels = 8;           ///< Rows of upper pixels a group may spread over.
  static constexpr int kBlockData = 3 * kBlock;  ///< Bytes of one block in data().

  struct Block {
    std::int32_t at[kGroups] = {};  ///< Where each group's first byte lies, from the frame's first.
    /// Rows of upper pixels: the greatest of the four groups. 0: the table spreads too far here and
    /// the block is read pixel by pixel.
    std::int32_t levels = 0;
  };

  /// The table's entries must lie in its frame. Keeps a reference to nothing.
  explicit RectifyPlan(const RectifyTable& table);

  /// Lays the plan for frames whose rows are `stride` bytes apart. Free when they were before.
  void set_stride(std::ptrdiff_t stride) noexcept;
  [[nodiscard]] std::ptrdiff_t stride() const noexcept { return stride_; }

  [[nodiscard]] int blocks() const noexcept { return blocks_; }  ///< In a row of the map.
  [[nodiscard]] const Block* row(int y) const noexcept { return head_.data() + at(y); }
  /// For each block of the row kBlockData bytes: 32 × position (column relative to the group's x in
  /// the low four bits, row relative to the group's y above), 32 × fx, 32 × fy. Pixels beyond the
  /// map's width repeat its last one. Bytes, since the memory's speed limits the kernel.
  [[nodiscard]] const std::uint8_t* data(int y) const noexcept {
    return data_.data() + at(y) * kBlockData;
  }

 private:
  [[nodiscard]] std::size_t at(int y) const noexcept {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(blocks_);
  }
  void add(std::span<const RectifyTable::Entry> entries, int frame_width, int frame_height);

  struct Corner {
    std::int16_t x = 0;
    std::int16_t y = 0;
  };

  int blocks_;
  std::ptrdiff_t stride_ = 0;
  std::vector<Block> head_;
  std::vector<Corner> corners_;  ///< for each group's bytes, kGroups a block
  std::vector<std::uint8_t> data_;
};

}  // namespace dtact::recon
