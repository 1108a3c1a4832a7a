// The line of `dtact-perceive watch`.
#include "clients/perceive/watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dtact::perceive {
namespace {

using testing::HasSubstr;

TEST(WatchLine, SaysWhyAForceIsMissing) {
  v1::Frame frame;
  v1::Contact& contact = *frame.mutable_contact();
  contact.set_in_contact(true);
  contact.set_force_absence(v1::FORCE_ABSENCE_UNCALIBRATED);
  EXPECT_THAT(watch_line(frame, 60), HasSubstr("force not calibrated"));
  contact.set_force_absence(v1::FORCE_ABSENCE_CUT_OFF);
  EXPECT_THAT(watch_line(frame, 60), HasSubstr("force cut_off"));
  contact.set_force_n(1.2);
  contact.set_force_uncertainty_n(0.03);
  contact.set_force_absence(v1::FORCE_ABSENCE_NONE);
  EXPECT_THAT(watch_line(frame, 60), HasSubstr("1.20 N +- 0.03"));
}

TEST(WatchLine, ContactThatIsNotMeasuredIsNotCalledNone) {
  v1::Frame frame;
  frame.set_contact_absence(v1::CONTACT_ABSENCE_UNCALIBRATED);
  EXPECT_EQ(watch_line(frame, 58.1), "58.1 fps  contact not measured: no calibration\n");
  frame.set_contact_absence(v1::CONTACT_ABSENCE_REFERENCING);
  EXPECT_EQ(watch_line(frame, 58.1),
            "58.1 fps  contact not measured: the reference is being taken\n");
  frame.mutable_contact()->set_in_contact(false);
  EXPECT_EQ(watch_line(frame, 58.1), "58.1 fps  no contact\n");
}

TEST(WatchLine, NamesTheTracking) {
  v1::Frame frame;
  frame.mutable_contact()->set_in_contact(true);
  frame.mutable_pose()->set_tracking(v1::ObjectPose::RECOVERED);
  EXPECT_THAT(watch_line(frame, 60), HasSubstr("  recovered: moved ("));
}

}  // namespace
}  // namespace dtact::perceive
