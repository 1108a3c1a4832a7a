#include "hal/luma/luma.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <stdexcept>
#include <utility>
#include <vector>

#include "tests/fakes/counted_loads.hpp"

namespace dtact::hal::luma {
namespace {

TEST(LumaBuffer, RowsAreAlignedAndTheTailIsReadable) {
  LumaBuffer buffer(100, 3);
  EXPECT_EQ(buffer.stride(), 128);
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(buffer.row(2)) % 64, 0U);
  EXPECT_EQ(buffer.row(2)[99 + kLumaPadding], 0);
  EXPECT_EQ(buffer.view().width, 100);
  EXPECT_EQ(buffer.view().height, 3);
}

TEST(LumaBuffer, MovesAndLeavesNothingBehind) {
  LumaBuffer first(64, 2);
  first.row(1)[5] = 42;
  LumaBuffer second(std::move(first));
  EXPECT_EQ(second.row(1)[5], 42);
  // NOLINTBEGIN(bugprone-use-after-move,clang-analyzer-cplusplus.Move): the state is documented
  EXPECT_EQ(first.data(), nullptr);
  EXPECT_EQ(first.width(), 0);
  // NOLINTEND(bugprone-use-after-move,clang-analyzer-cplusplus.Move)
  LumaBuffer third;
  third = std::move(second);
  EXPECT_EQ(third.stride(), 64);
  EXPECT_EQ(third.row(1)[5], 42);
}

TEST(LumaBuffer, RefusesSizesNoCameraHas) {
  EXPECT_THROW(LumaBuffer(0, 1), std::invalid_argument);
  EXPECT_THROW(LumaBuffer(1, -1), std::invalid_argument);
  EXPECT_THROW(LumaBuffer(16385, 1), std::invalid_argument);
}

TEST(Extract, LimitedRangeMapsBlackAndWhiteAndRoundsToNearest) {
  // 255/219 = 1.164; 2.329, 3.493, 6.986, 128.08, 253.84.
  const std::vector<std::uint8_t> payload = {0, 16, 17, 18, 19, 22, 126, 234, 235, 255};
  const std::vector<int> expanded = {0, 0, 1, 2, 3, 7, 128, 254, 255, 255};
  LumaBuffer out(10, 1);
  ASSERT_EQ(extract(Layout::grey, Range::limited, payload, 0, out), ExtractStatus::ok);
  for (int x = 0; x < 10; ++x) {
    EXPECT_EQ(out.row(0)[x], expanded[static_cast<std::size_t>(x)]) << x;
  }
}

TEST(Extract, GreyKeepsFullRangeAsItIs) {
  const std::vector<std::uint8_t> payload = {0, 16, 235, 255, 1, 2};
  LumaBuffer out(3, 2);
  ASSERT_EQ(extract(Layout::grey, Range::full, payload, 0, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(0)[0], 0);
  EXPECT_EQ(out.row(0)[1], 16);
  EXPECT_EQ(out.row(0)[2], 235);
  EXPECT_EQ(out.row(1)[0], 255);
  EXPECT_EQ(out.row(1)[2], 2);
}

TEST(Extract, MoreThanEightBitsKeepTheUpperEight) {
  // 1023, 512, 3 and 4 of ten bits; 65535, 32768, 255 and 256 of sixteen.
  const std::vector<std::uint8_t> ten = {0xFF, 0x03, 0x00, 0x02, 0x03, 0x00, 0x04, 0x00, 99};
  const std::vector<std::uint8_t> sixteen = {0xFF, 0xFF, 0x00, 0x80, 0xFF, 0x00, 0x00, 0x01, 99};
  LumaBuffer out(2, 2);
  EXPECT_EQ(payload_bytes(Layout::grey10, 2, 2, 0), 8U);
  ASSERT_EQ(extract(Layout::grey10, Range::full, ten, 0, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(0)[0], 255);
  EXPECT_EQ(out.row(0)[1], 128);
  EXPECT_EQ(out.row(1)[0], 0);
  EXPECT_EQ(out.row(1)[1], 1);
  ASSERT_EQ(extract(Layout::grey16, Range::full, sixteen, 4, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(0)[0], 255);
  EXPECT_EQ(out.row(0)[1], 128);
  EXPECT_EQ(out.row(1)[0], 0);
  EXPECT_EQ(out.row(1)[1], 1);
  LumaBuffer odd(3, 1);
  EXPECT_EQ(extract(Layout::grey10, Range::full, ten, 0, odd), ExtractStatus::ok);
  EXPECT_EQ(extract(Layout::grey16, Range::full, std::span(ten).first(5), 0, odd),
            ExtractStatus::short_payload);
}

TEST(Extract, YuyvTakesEverySecondByteAndExpands) {
  const std::vector<std::uint8_t> payload = {16, 99, 235, 99, 126, 99, 10, 99};
  LumaBuffer out(4, 1);
  ASSERT_EQ(extract(Layout::yuyv, Range::limited, payload, 0, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(0)[0], 0);
  EXPECT_EQ(out.row(0)[1], 255);
  EXPECT_EQ(out.row(0)[2], 128);
  EXPECT_EQ(out.row(0)[3], 0);
  ASSERT_EQ(extract(Layout::yuyv, Range::full, payload, 0, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(0)[1], 235);
  EXPECT_EQ(out.row(0)[3], 10);
}

TEST(Extract, Nv12ReadsTheFirstPlaneAndWantsTheSecond) {
  std::vector<std::uint8_t> payload = {1, 2, 3, 4, 128, 128};
  LumaBuffer out(2, 2);
  ASSERT_EQ(extract(Layout::nv12, Range::full, payload, 0, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(1)[1], 4);
  payload.pop_back();
  EXPECT_EQ(extract(Layout::nv12, Range::full, payload, 0, out), ExtractStatus::short_payload);
}

TEST(Extract, HonoursPaddedLines) {
  const std::vector<std::uint8_t> payload = {1, 2, 0, 0, 3, 4};
  LumaBuffer out(2, 2);
  ASSERT_EQ(extract(Layout::grey, Range::full, payload, 4, out), ExtractStatus::ok);
  EXPECT_EQ(out.row(0)[1], 2);
  EXPECT_EQ(out.row(1)[0], 3);
}

TEST(Extract, ShortPayloadsWriteNothing) {
  LumaBuffer out(4, 2);
  const std::vector<std::uint8_t> payload(15, 200);
  EXPECT_EQ(extract(Layout::yuyv, Range::full, payload, 0, out), ExtractStatus::short_payload);
  EXPECT_EQ(extract(Layout::grey, Range::full, {}, 0, out), ExtractStatus::short_payload);
  EXPECT_EQ(out.row(0)[0], 0);
}

TEST(Extract, RefusesShapesTheLayoutCannotHave) {
  const std::vector<std::uint8_t> payload(1000, 0);
  LumaBuffer odd(3, 2);
  EXPECT_EQ(extract(Layout::yuyv, Range::full, payload, 0, odd), ExtractStatus::bad_shape);
  EXPECT_EQ(extract(Layout::nv12, Range::full, payload, 0, odd), ExtractStatus::bad_shape);
  LumaBuffer even(4, 2);
  EXPECT_EQ(extract(Layout::grey, Range::full, payload, 3, even), ExtractStatus::bad_shape);
  LumaBuffer none;
  EXPECT_EQ(extract(Layout::grey, Range::full, payload, 0, none), ExtractStatus::bad_shape);
}

// A Pi's drivers give uncached memory.
TEST(Extract, ReadsMemoryWithoutCachesInWideLoads) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "a sanitizer's build is not the one whose loads count";
#endif
  constexpr int kWidth = 800;
  constexpr int kHeight = 8;
  const fakes::CountedLoads payload(std::size_t{2} * kWidth * kHeight);
  LumaBuffer out(kWidth, kHeight);
  for (const Layout layout : {Layout::grey, Layout::grey10, Layout::grey16, Layout::yuyv}) {
    for (const Range range : {Range::full, Range::limited}) {
      const std::size_t bytes = payload_bytes(layout, kWidth, kHeight, 0);
      const auto loads = payload.count(
          [&] { (void)extract(layout, range, payload.bytes().first(bytes), 0, out); });
      if (!loads) GTEST_SKIP() << "loads can be counted on x86-64 only";
      EXPECT_GT(*loads, 0U);
      EXPECT_LE(*loads, bytes / 8) << static_cast<int>(layout) << " " << static_cast<int>(range);
    }
  }
}

}  // namespace
}  // namespace dtact::hal::luma
