#include "daemon/recon/tiles.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <utility>
#include <vector>

namespace dtact::recon {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

std::vector<std::pair<int, int>> runs(std::uint64_t row) {
  std::vector<std::pair<int, int>> found;
  for_each_run(row, [&](int first, int last) {
    if (found.size() == 32) throw std::logic_error("more runs than a word has");
    found.emplace_back(first, last);
  });
  return found;
}

TEST(ForEachRun, VisitsEachRunUpToTheWordsLastBit) {
  EXPECT_THAT(runs(0), IsEmpty());
  EXPECT_THAT(runs(0b1011'0110), ElementsAre(Pair(1, 3), Pair(4, 6), Pair(7, 8)));
  EXPECT_THAT(runs(std::uint64_t{1} << 63U), ElementsAre(Pair(63, 64)));
  EXPECT_THAT(runs(~std::uint64_t{0}), ElementsAre(Pair(0, 64)));
  EXPECT_THAT(runs(0xC000'0000'0000'0001), ElementsAre(Pair(0, 1), Pair(62, 64)));
}

TEST(TileGrid, ARowOfTilesIsOneWord) {
  const TileGrid usual(580, 580);
  EXPECT_EQ(usual.columns(), 19);
  EXPECT_EQ(usual.rows(), 37);
  EXPECT_EQ(usual.all(), 0x7'FFFFU);
  const TileGrid widest(2048, 16);
  EXPECT_EQ(widest.columns(), 64);
  EXPECT_EQ(widest.all(), ~std::uint64_t{0});
  const TileGrid wider(2049, 17);
  EXPECT_EQ(wider.tile_width(), 64);
  EXPECT_EQ(wider.columns(), 33);
  EXPECT_EQ(wider.rows(), 2);
}

}  // namespace
}  // namespace dtact::recon
