#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/pipeline/histogram.hpp"
#include "daemon/pipeline/latest_slot.hpp"
#include "daemon/pipeline/spsc_queue.hpp"
#include "hal/base/background_thread.hpp"

namespace dtact::pipeline {
namespace {

TEST(LatestSlot, IsEmptyUntilSomethingIsPublished) {
  LatestSlot<int> slot(7);
  EXPECT_EQ(slot.fetch(), nullptr);
  EXPECT_EQ(slot.back(), 7);
  EXPECT_EQ(slot.replaced(), 0U);
}

TEST(LatestSlot, HandsOutEachResultOnce) {
  LatestSlot<int> slot(0);
  slot.back() = 1;
  slot.publish();
  const int* one = slot.fetch();
  ASSERT_NE(one, nullptr);
  EXPECT_EQ(*one, 1);
  EXPECT_EQ(slot.fetch(), nullptr);
}

TEST(LatestSlot, NewestWinsAndTheOthersAreCounted) {
  LatestSlot<int> slot(0);
  for (int i = 1; i <= 5; ++i) {
    slot.back() = i;
    slot.publish();
  }
  const int* newest = slot.fetch();
  ASSERT_NE(newest, nullptr);
  EXPECT_EQ(*newest, 5);
  EXPECT_EQ(slot.replaced(), 4U);
}

TEST(LatestSlot, WhatTheReaderHoldsIsNotWritten) {
  LatestSlot<int> slot(0);
  slot.back() = 1;
  slot.publish();
  const int* held = slot.fetch();
  for (int i = 2; i < 10; ++i) {
    slot.back() = i;
    slot.publish();
    EXPECT_EQ(*held, 1);
  }
}

TEST(LatestSlot, TwoThreadsNeverTear) {
  using Block = std::array<std::uint64_t, 64>;
  LatestSlot<Block> slot(Block{});
  constexpr std::uint64_t kRounds = 50'000;
  std::thread writer([&] {
    for (std::uint64_t i = 1; i <= kRounds; ++i) {
      slot.back().fill(i);
      slot.publish();
    }
  });
  std::uint64_t last = 0;
  std::uint64_t fetched = 0;
  bool whole = true;
  bool rising = true;
  while (last < kRounds) {
    const Block* block = slot.fetch();
    if (block == nullptr) {
      std::this_thread::yield();
      continue;
    }
    for (const std::uint64_t value : *block) whole = whole && value == block->front();
    rising = rising && block->front() > last;
    last = block->front();
    ++fetched;
  }
  writer.join();
  EXPECT_TRUE(whole);
  EXPECT_TRUE(rising);
  EXPECT_EQ(fetched + slot.replaced(), kRounds);
}

TEST(SpscQueue, KeepsOrderAndSaysWhenEmptyOrFull) {
  SpscQueue<int, 4> queue;
  int out = 0;
  EXPECT_FALSE(queue.pop(out));
  EXPECT_EQ(queue.room(), 4U);
  for (int round = 0; round < 3; ++round) {  // over the end of the ring
    for (int i = 0; i < 4; ++i) EXPECT_TRUE(queue.push(10 * round + i));
    EXPECT_FALSE(queue.push(99));
    EXPECT_EQ(queue.room(), 0U);
    for (int i = 0; i < 4; ++i) {
      ASSERT_TRUE(queue.pop(out));
      EXPECT_EQ(out, 10 * round + i);
    }
    EXPECT_FALSE(queue.pop(out));
  }
}

TEST(SpscQueue, ARefusedValueStaysWithTheCaller) {
  SpscQueue<std::unique_ptr<int>, 1> queue;
  EXPECT_TRUE(queue.push(std::make_unique<int>(1)));
  auto second = std::make_unique<int>(2);
  EXPECT_FALSE(queue.push(std::move(second)));
  // NOLINTBEGIN(bugprone-use-after-move,clang-analyzer-cplusplus.Move): refused, hence not moved
  ASSERT_NE(second, nullptr);
  EXPECT_EQ(*second, 2);
  // NOLINTEND(bugprone-use-after-move,clang-analyzer-cplusplus.Move)
}

TEST(SpscQueue, APoppedSlotKeepsNothingAlive) {
  SpscQueue<std::shared_ptr<int>, 2> queue;
  auto value = std::make_shared<int>(1);
  EXPECT_TRUE(queue.push(std::shared_ptr<int>(value)));
  std::shared_ptr<int> out;
  ASSERT_TRUE(queue.pop(out));
  out.reset();
  EXPECT_EQ(value.use_count(), 1);
}

TEST(SpscQueue, TwoThreadsLoseNothing) {
  SpscQueue<std::uint64_t, 8> queue;
  constexpr std::uint64_t kCount = 100'000;
  std::thread producer([&] {
    for (std::uint64_t i = 1; i <= kCount; ++i) {
      while (!queue.push(std::uint64_t{i})) std::this_thread::yield();
    }
  });
  std::uint64_t wanted = 1;
  bool in_order = true;
  while (wanted <= kCount) {
    std::uint64_t got = 0;
    if (!queue.pop(got)) {
      std::this_thread::yield();
      continue;
    }
    in_order = in_order && got == wanted++;
  }
  producer.join();
  EXPECT_TRUE(in_order);
}

TEST(Histogram, IsZeroWhileEmpty) {
  const Histogram histogram;
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.percentile_ns(0.99), 0);
  EXPECT_EQ(histogram.max_ns(), 0);
}

TEST(Histogram, SmallValuesAreExact) {
  Histogram histogram;
  for (int i = 1; i <= 60; ++i) histogram.add(i);
  EXPECT_EQ(histogram.percentile_ns(0.5), 30);
  EXPECT_EQ(histogram.percentile_ns(0), 1);
  EXPECT_EQ(histogram.percentile_ns(1), 60);
}

TEST(Histogram, LargeValuesAreWithinAThirtySecond) {
  Histogram histogram;
  for (int i = 0; i < 99; ++i) histogram.add(1'000'000);
  histogram.add(16'000'000);
  EXPECT_GE(histogram.percentile_ns(0.5), 1'000'000);
  EXPECT_LE(histogram.percentile_ns(0.5), 1'032'000);
  EXPECT_LE(histogram.percentile_ns(0.99), 1'032'000);
  EXPECT_EQ(histogram.percentile_ns(1), 16'000'000);
  EXPECT_EQ(histogram.max_ns(), 16'000'000);
}

// The upper six bits name a bucket: from 64 on it is two wide, from 128 on four.
TEST(Histogram, APercentileIsTheLastValueOfItsBucket) {
  const auto median_of = [](std::int64_t ns) {
    Histogram histogram;
    histogram.add(ns);
    histogram.add(ns);
    histogram.add(INT64_MAX);
    return histogram.percentile_ns(0.5);
  };
  EXPECT_EQ(median_of(63), 63);
  EXPECT_EQ(median_of(64), 65);
  EXPECT_EQ(median_of(65), 65);
  EXPECT_EQ(median_of(66), 67);
  EXPECT_EQ(median_of(127), 127);
  EXPECT_EQ(median_of(128), 131);
  EXPECT_EQ(median_of(1'000'000), 1'015'807);  // 62 · 2¹⁴ − 1
}

TEST(Histogram, TakesTheExtremes) {
  Histogram histogram;
  histogram.add(-5);
  histogram.add(INT64_MAX);
  EXPECT_EQ(histogram.count(), 2U);
  EXPECT_EQ(histogram.percentile_ns(0.5), 0);
  EXPECT_EQ(histogram.max_ns(), (std::int64_t{1} << 40) - 1);
}

TEST(Histogram, CountsWhatIsWithinBounds) {
  Histogram histogram;
  histogram.add(5);
  histogram.add(40);
  histogram.add(1'000'000);
  histogram.add(16'000'000);
  std::array<std::uint64_t, 4> counts{};
  // 1,000,000 lies in a bucket that the same bound cuts: it counts above.
  EXPECT_EQ(histogram.cumulate(std::array<std::int64_t, 4>{5, 39, 1'000'000, 1'040'000}, counts),
            4U);
  EXPECT_EQ(counts, (std::array<std::uint64_t, 4>{1, 1, 2, 3}));
  EXPECT_EQ(histogram.sum_ns(), 17'000'045);
}

TEST(BackgroundThread, DoesWhatItWasGivenOfEachJobBeforeItEnds) {
  std::vector<int> done;
  base::BackgroundThread thread("side");
  base::BackgroundThread::Job one(thread, [&] { done.push_back(1); });
  base::BackgroundThread::Job two(thread, [&] { done.push_back(2); });
  two.hand_over();
  EXPECT_TRUE(two.busy());
  EXPECT_FALSE(one.busy());
  thread.start();
  two.settle();
  one.hand_over();
  two.hand_over();
  thread.stop();
  EXPECT_EQ(done, (std::vector<int>{2, 1, 2}));
  EXPECT_FALSE(one.busy() || two.busy());
}

}  // namespace
}  // namespace dtact::pipeline
