#include "daemon/recon/cells.hpp"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tests/unit/recon/every_target.hpp"

namespace dtact::recon::vec {
namespace {

class Cells : public EveryTarget {};

// Before: the sum of all grey levels was one of 32 bits, so that a white picture of more than 16.8
// megapixels was dark.
TEST_P(Cells, TotalsOfALargeFrameDoNotOverflow) {
  if (GetParam() == HWY_SCALAR) GTEST_SKIP() << "one lane of 32 bits; no processor chooses it";
  constexpr int kColumns = 512;
  constexpr int kRows = 300;
  constexpr int kStride = padded_cells(kColumns);
  constexpr std::size_t kCount = std::size_t{kStride} * kRows;
  constexpr std::size_t kBeyond = kCellBlock + kStride;
  constexpr std::int32_t kWhite = 255 * kCellPixels;
  std::vector<std::int32_t> sum(kCount);
  for (std::size_t i = 0; i < kCount; ++i) sum[i] = i % kStride < kColumns ? kWhite : 0;
  const std::vector<std::int32_t> zeros(kCount);
  std::vector<std::int32_t> cell(kCount);
  std::vector<std::int32_t> change(kCount + 2 * kBeyond);
  std::vector<std::int32_t> window = change;
  std::vector<std::int32_t> active = change;
  const CellTotals totals = compare_cells({.stride = kStride,
                                           .rows = kRows,
                                           .window_columns = kColumns - 1,
                                           .window_rows = kRows - 1,
                                           .sum = sum.data(),
                                           .sum_before = zeros.data(),
                                           .expected = zeros.data(),
                                           .change = change.data() + kBeyond,
                                           .cell = cell.data(),
                                           .window = window.data() + kBeyond,
                                           .active = active.data() + kBeyond},
                                          {});
  EXPECT_EQ(totals.grey, std::int64_t{kColumns} * kRows * kWhite);
  EXPECT_EQ(totals.quiet_step, std::int64_t{kColumns} * kRows * kWhite);
}

DTACT_EVERY_TARGET(Cells);

}  // namespace
}  // namespace dtact::recon::vec
