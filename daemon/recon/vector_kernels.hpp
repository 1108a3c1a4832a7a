#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/rectify_plan.hpp"
#include "daemon/recon/sharpen_kernels.hpp"

/// The scalar kernels of kernels.hpp with the machine's vector instructions, chosen at run time.
/// Same bits, other shapes: rows come in pairs and in blocks of 32 pixels.
namespace dtact::recon::vec {

inline constexpr int kBlock = RectifyPlan::kBlock;

/// Pixels a row buffer needs for `width` pixels of image.
[[nodiscard]] constexpr int padded(int width) noexcept {
  return (width + kBlock - 1) / kBlock * kBlock;
}

/// kernels::rectify_difference_row for the groups [first, last) of eight pixels of map row `y`,
/// with the stride the plan was laid for. `reference_q6` and `difference_q6` begin at the row's
/// first pixel and hold whole blocks. `entries` is the same row of the table, `width` pixels.
void rectify_difference(const RectifyPlan& plan, int y, int first, int last,
                        const std::uint8_t* luma, const RectifyTable::Entry* entries, int width,
                        const std::int16_t* reference_q6, std::int16_t* difference_q6) noexcept;

/// kernels::rectify_mean_difference_row of row `y` of a coarse map for the groups [first, last) of
/// eight of the plan's pixels. `entries`: of the first of its rows in the table, `fine_width` a
/// row.
void rectify_mean_difference(const RectifyPlan& plan, int decimation, int y, int first, int last,
                             const std::uint8_t* luma, const RectifyTable::Entry* entries,
                             int fine_width, const std::int16_t* reference_q6,
                             std::int16_t* difference_q6) noexcept;

/// The taps of a symmetric kernel as the pair kernels want them: full length, made a multiple of
/// two longer by zeros, two to a word. Two neighbouring results share every load: the second one's
/// taps are the first one's, moved by one place.
class TapPairs {
 public:
  /// `taps`: Q14 from the centre outwards, radius ≤ kernels::kMaxRadius.
  explicit TapPairs(std::span<const std::int16_t> taps);
  /// Even, at least the kernel's radius: how far rows are read on either side.
  [[nodiscard]] int radius() const noexcept { return radius_; }
  [[nodiscard]] int count() const noexcept { return radius_ + 1; }
  /// count() words for the first of the two results, then as many for the second. The tap of the
  /// lower coordinate is in the low half.
  [[nodiscard]] const std::int32_t* words() const noexcept { return words_.data(); }

 private:
  int radius_;
  std::vector<std::int32_t> words_;
};

/// kernels::smooth_horizontal_row of two rows for the blocks [first, last). Reads radius() pixels
/// before and after the blocks. `pairs` receives 64 values a block: first the even
/// columns, then the odd ones, each as (value of row a, value of row b).
void smooth_across(const std::int16_t* row_a, const std::int16_t* row_b, const TapPairs& taps,
                   int first, int last, std::int16_t* pairs) noexcept;

/// kernels::smooth_vertical_row of two rows for the blocks [first, last): `pairs` points at count()
/// pair rows written by smooth_across, the one of the two rows themselves in the middle.
void smooth_down(const std::int16_t* const* pairs, const TapPairs& taps, int first, int last,
                 std::int16_t* row_a, std::int16_t* row_b) noexcept;

/// A rectangle of rows. Pointers are to the first pixel of the first row; rows of each plane lie
/// their own number of values apart.
struct LutRows {
  const std::int16_t* difference_q6 = nullptr;
  std::ptrdiff_t difference_stride = 0;
  /// 0: untrusted (no light has that gain), which saves a plane of marks. Null: one everywhere.
  const std::int16_t* gain_q12 = nullptr;
  std::ptrdiff_t gain_stride = 0;
  std::int16_t* depth_um = nullptr;
  std::ptrdiff_t depth_stride = 0;
  int width = 0;
  int height = 0;
};

/// kernels::gain_lut_mask_row of each row: `width` pixels are written, inputs are read in whole
/// blocks. The depth may be written over the difference. After the LUT's last entry must stand
/// kUntrusted once more: untrusted pixels look that up.
int gain_lut_mask(const LutRows& rows, const kernels::LutView& lut) noexcept;

/// kernels::lit_row for the blocks [first, last).
void lit_row(const std::int16_t* difference_q6, const std::int16_t* gain_q12, int first, int last,
             std::int16_t* level_q6) noexcept;

/// kernels::shrink_row of the blocks [first, last) of the fine rows, kBlock / kCoarse values each.
void shrink_row(const std::int16_t* const* rows, int first, int last,
                std::int16_t* coarse) noexcept;

/// What kernels::sharpen_row reads, from each row's first pixel on.
struct SharpenRows {
  const std::int16_t* level = nullptr;
  const std::int16_t* before = nullptr;
  const std::int16_t* narrow = nullptr;
  kernels::WideRows wide;
};

/// kernels::sharpen_row for the blocks [first, last). `after` begins at the row's first pixel, too.
void sharpen_row(const SharpenRows& rows, std::int16_t wide_share_q15, int first, int last,
                 std::int16_t* after) noexcept;

/// kernels::sum_row of the pixels [x0, x1) of the rows [y0, y1) of a map whose rows are `stride`
/// values apart. Reads no other pixel.
void sum_rows(const std::int16_t* depth_um, std::ptrdiff_t stride, int x0, int x1, int y0, int y1,
              DepthSums& sums) noexcept;

/// kernels::bend_row.
void bend_row(const std::int16_t* row_um, std::ptrdiff_t stride, int x0, int x1,
              DepthSums& sums) noexcept;

/// Name of the instruction set the kernels run with.
[[nodiscard]] const char* target_name() noexcept;

}  // namespace dtact::recon::vec
