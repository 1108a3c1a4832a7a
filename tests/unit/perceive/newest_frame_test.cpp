// What is known of frames that were not taken.
#include "clients/perceive/newest_frame.hpp"

#include <gtest/gtest.h>

namespace dtact::perceive {
namespace {

v1::Frame frame_of(std::uint64_t sequence, bool in_contact) {
  v1::Frame frame;
  frame.set_sequence(sequence);
  frame.mutable_contact()->set_in_contact(in_contact);
  return frame;
}

TEST(NewestFrame, IsTakenOnceAndCountsWhatItReplaced) {
  NewestFrame newest;
  EXPECT_FALSE(newest.take().has_value());
  for (const std::uint64_t sequence : {1U, 2U, 3U}) newest.put(frame_of(sequence, true));
  const auto taken = newest.take();
  ASSERT_TRUE(taken.has_value());
  EXPECT_EQ(taken->frame.sequence(), 3U);
  EXPECT_EQ(taken->missed, 2U);
  EXPECT_FALSE(taken->parted) << "it was in contact throughout";
  EXPECT_FALSE(newest.take().has_value());
}

TEST(NewestFrame, AReleaseThatWasReplacedIsReported) {
  NewestFrame newest;
  newest.put(frame_of(1, true));
  (void)newest.take();
  newest.put(frame_of(2, false));
  newest.put(frame_of(3, true));
  newest.put(frame_of(4, true));
  EXPECT_TRUE(newest.take()->parted);
  newest.put(frame_of(5, true));
  EXPECT_FALSE(newest.take()->parted) << "once";
}

// After a restart of the daemon the same sequence may be another frame.
TEST(NewestFrame, OfAnotherConnectionItIsAnotherContact) {
  NewestFrame newest;
  newest.put(frame_of(1, true));
  newest.part();
  EXPECT_FALSE(newest.take().has_value());
  newest.put(frame_of(1, true));
  newest.put(frame_of(2, true));
  EXPECT_TRUE(newest.take()->parted);
}

// The link was too slow for them; a new connection counts anew.
TEST(NewestFrame, CountsWhatTheDaemonDropped) {
  NewestFrame newest;
  newest.put(frame_of(1, true));
  EXPECT_EQ(newest.take()->missed, 0U);
  v1::Frame late = frame_of(5, true);
  late.set_dropped(3);
  newest.put(late);
  EXPECT_EQ(newest.take()->missed, 3U);
  newest.part();
  v1::Frame anew = frame_of(1, true);
  anew.set_dropped(1);
  newest.put(anew);
  EXPECT_EQ(newest.take()->missed, 1U);
}

// A frame without a contact measurement, as while the light settles, is not a release.
TEST(NewestFrame, WhatWasNotMeasuredIsNoRelease) {
  NewestFrame newest;
  newest.put({});
  newest.put(frame_of(2, true));
  EXPECT_FALSE(newest.take()->parted);
}

}  // namespace
}  // namespace dtact::perceive
