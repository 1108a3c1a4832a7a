#include "clients/ctl/light_step.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace dtact::ctl {
namespace {

using Verdict = LightStep::Verdict;

/// Frame 10 was the last before the step, at 100 grey levels; 11 and 12 still show the old light.
Verdict feed(LightStep& step, const std::vector<double>& lit, std::uint64_t first = 13) {
  EXPECT_EQ(step.add(11, false, 100), Verdict::going_on);
  EXPECT_EQ(step.add(12, false, 100), Verdict::going_on);
  Verdict verdict = Verdict::going_on;
  for (const double grey : lit) {
    EXPECT_EQ(verdict, Verdict::going_on);
    verdict = step.add(first++, true, grey);
  }
  return verdict;
}

std::vector<double> then(std::vector<double> begin, std::size_t count, double grey) {
  begin.insert(begin.end(), count, grey);
  return begin;
}

TEST(LightStep, CountsTheFramesThatAreNotComplete) {
  LightStep step(100, 10);
  EXPECT_EQ(feed(step, then({100, 100, 62}, 8, 30)), Verdict::settled);
  EXPECT_EQ(step.frames(), 3);
  EXPECT_EQ(step.grey(), 30);
}

TEST(LightStep, AFrameWithinAFiftiethOfTheStepIsComplete) {
  LightStep step(100, 10);
  EXPECT_EQ(feed(step, then({65}, 7, 30)), Verdict::going_on);
  EXPECT_EQ(step.add(21, true, 31.3), Verdict::settled);
  EXPECT_EQ(step.frames(), 1);
}

TEST(LightStep, ALightThatIsCompleteAtOnceTakesNoFrame) {
  LightStep step(100, 10);
  EXPECT_EQ(feed(step, then({}, 8, 160)), Verdict::settled);
  EXPECT_EQ(step.frames(), 0);
}

TEST(LightStep, WaitsForAQueueOfManyFrames) {
  LightStep step(100, 10);
  EXPECT_EQ(feed(step, then(then({}, 40, 100), 8, 30)), Verdict::settled);
  EXPECT_EQ(step.frames(), 40);
}

TEST(LightStep, APictureThatStaysIsNoStep) {
  LightStep step(100, 10);
  EXPECT_EQ(feed(step, then({}, 120, 103)), Verdict::unseen);
}

TEST(LightStep, AnUnsteadyImageIsNotAtRest) {
  LightStep step(100, 10);
  std::vector<double> alternating;
  for (int i = 0; i < 120; ++i) alternating.push_back(i % 2 == 0 ? 30 : 40);
  EXPECT_EQ(feed(step, alternating), Verdict::restless);
}

TEST(LightStep, AFrameMissingWhereItMattersIsAGap) {
  LightStep first(100, 10);  // 13 is not known to have been lit
  EXPECT_EQ(feed(first, then({60}, 8, 30), 14), Verdict::gap);

  LightStep within(100, 10);  // 14 may have been complete or not
  (void)within.add(12, false, 100);
  (void)within.add(13, true, 60);
  Verdict verdict = Verdict::going_on;
  for (std::uint64_t i = 15; i < 23; ++i) verdict = within.add(i, true, 30);
  EXPECT_EQ(verdict, Verdict::gap);

  LightStep after(100, 10);  // 15 came after it was complete
  (void)after.add(12, false, 100);
  (void)after.add(13, true, 60);
  verdict = after.add(14, true, 30);
  for (std::uint64_t i = 16; i < 23; ++i) verdict = after.add(i, true, 30);
  EXPECT_EQ(verdict, Verdict::settled);
  EXPECT_EQ(after.frames(), 1);
}

}  // namespace
}  // namespace dtact::ctl
