// The filter's vector kernels against the scalar ones, over the whole range of every value.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include "daemon/recon/vector_kernels.hpp"
#include "tests/unit/recon/every_target.hpp"

namespace dtact::recon::vec {
namespace {

using kernels::kCoarse;
using kernels::kSmoothable;

class VectorSharpen : public EveryTarget {
 protected:
  static constexpr int kMaxBlocks = 19;
  static constexpr std::int16_t kUnwritten = 12321;

  int uniform(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
  /// Values of the whole range, including its ends.
  std::vector<std::int16_t> values(int count, int low, int high) {
    std::vector<std::int16_t> out(static_cast<std::size_t>(count));
    for (std::int16_t& v : out) {
      const int dice = uniform(0, 5);
      v = static_cast<std::int16_t>(dice == 0 ? low : dice == 1 ? high : uniform(low, high));
    }
    return out;
  }
  std::vector<std::int16_t> levels(int count) { return values(count, -kSmoothable, kSmoothable); }
  /// Checks that blocks `first` to `last` equal `all` and that nothing else was written.
  static void expect_part(const std::vector<std::int16_t>& part,
                          const std::vector<std::int16_t>& all, int first, int last) {
    for (int x = 0; x < static_cast<int>(all.size()); ++x) {
      const auto at = static_cast<std::size_t>(x);
      ASSERT_EQ(part[at], x >= first && x < last ? all[at] : kUnwritten) << x;
    }
  }

 private:
  std::minstd_rand random_{17};
};

TEST_P(VectorSharpen, LitRow) {
  for (int blocks = 1; blocks <= kMaxBlocks; ++blocks) {
    const int width = blocks * kBlock;
    const auto difference = values(width, -32768, 32767);
    auto gain = values(width, 0, 32767);
    std::vector<std::int16_t> all(gain.size());
    kernels::lit_row(difference.data(), gain.data(), width, all.data());
    const int first = uniform(0, blocks - 1);
    const int last = uniform(first, blocks);
    std::vector<std::int16_t> part(all.size(), kUnwritten);
    lit_row(difference.data(), gain.data(), first, last, part.data());
    expect_part(part, all, first * kBlock, last * kBlock);
  }
}

TEST_P(VectorSharpen, ShrinkRow) {
  for (int blocks = 1; blocks <= kMaxBlocks; ++blocks) {
    std::vector<std::vector<std::int16_t>> fine;
    std::vector<const std::int16_t*> rows;
    for (int i = 0; i < kCoarse; ++i) fine.push_back(levels(blocks * kBlock));
    for (const auto& row : fine) rows.push_back(row.data());
    std::vector<std::int16_t> all(static_cast<std::size_t>(blocks * kBlock / kCoarse));
    kernels::shrink_row(rows.data(), static_cast<int>(all.size()), all.data());
    const int first = uniform(0, blocks - 1);
    const int last = uniform(first, blocks);
    std::vector<std::int16_t> part(all.size(), kUnwritten);
    shrink_row(rows.data(), first, last, part.data());
    expect_part(part, all, first * kBlock / kCoarse, last * kBlock / kCoarse);
  }
}

TEST_P(VectorSharpen, SharpenRow) {
  for (int blocks = 1; blocks <= kMaxBlocks; ++blocks) {
    const int width = blocks * kBlock;
    const auto level = levels(width);
    const auto before = levels(width);
    const auto narrow = levels(width);
    const auto near = levels(width / kCoarse + 2);
    const auto other = levels(width / kCoarse + 2);
    const auto share = static_cast<std::int16_t>(uniform(0, 32767));
    const kernels::WideRows wide{
        near.data() + 1, other.data() + 1,
        static_cast<std::int16_t>(blocks % 2 == 0 ? kernels::kEighth : 3 * kernels::kEighth)};
    std::vector<std::int16_t> all(level.size());
    kernels::sharpen_row(level.data(), before.data(), narrow.data(), wide, share, width,
                         all.data());
    const int first = uniform(0, blocks - 1);
    const int last = uniform(first, blocks);
    std::vector<std::int16_t> part(all.size(), kUnwritten);
    sharpen_row({level.data(), before.data(), narrow.data(), wide}, share, first, last,
                part.data());
    expect_part(part, all, first * kBlock, last * kBlock);
    // In place, like the second step.
    std::vector<std::int16_t> own = before;
    sharpen_row({level.data(), own.data(), narrow.data(), wide}, share, 0, blocks, own.data());
    ASSERT_EQ(own, all);
  }
}

DTACT_EVERY_TARGET(VectorSharpen);

}  // namespace
}  // namespace dtact::recon::vec
