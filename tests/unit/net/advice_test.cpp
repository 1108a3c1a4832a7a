#include "daemon/net/advice.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dtact::net {
namespace {

using pipeline::Health;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

TEST(Advice, IsEmptyWhenAllIsWell) {
  pipeline::Status status;
  status.state = pipeline::State::serving;
  EXPECT_EQ(advice(status), "");
}

TEST(Advice, SaysHowToCalibrate) {
  pipeline::Status status;
  status.health.set(Health::uncalibrated);
  EXPECT_THAT(advice(status), HasSubstr("dtact-calibrate depth"));
  EXPECT_THAT(advice(status), HasSubstr("dtactctl calibration upload"));
}

TEST(Advice, HasASentenceForEveryCondition) {
  for (int i = 0; i < pipeline::kHealthCount; ++i) {
    pipeline::Status status;
    status.health.set(static_cast<Health>(i));
    EXPECT_NE(advice(status), "") << i;
    EXPECT_EQ(fix(status, static_cast<Health>(i)), advice(status)) << i;
  }
}

TEST(Advice, AddsTheDevicesOwnSentenceAndPutsItFirst) {
  pipeline::Status status;
  status.state = pipeline::State::camera_lost;
  status.camera_report.fix = "/dev/video0 is gone: plug it in.";
  EXPECT_EQ(advice(status), "The camera is away. /dev/video0 is gone: plug it in.");
  status.health.set(Health::camera_fault);
  status.health.set(Health::not_realtime);
  EXPECT_THAT(
      advice(status),
      StartsWith("The camera gives no usable frames. /dev/video0 is gone: plug it in. The capture "
                 "thread"));
  status.health.set(Health::ring_fault);
  status.ring_message = "the ring is gone.";
  EXPECT_THAT(advice(status), HasSubstr("LED ring cannot be written to. the ring is gone."));
}

TEST(Advice, SaysWhatToDoAboutDamagedFramesOnly) {
  pipeline::Status status;
  status.health.set(Health::camera_fault);
  status.camera_damaged = true;
  EXPECT_EQ(advice(status),
            "The camera gives no usable frames. All that come are damaged: check its USB cable, "
            "hub and port, or set another pixel_format or a lower camera.fps.");
  status.camera_report.damage_reason = "the payload's coded data is broken";
  EXPECT_THAT(advice(status), HasSubstr("damaged (the payload's coded data is broken): check its"));
  status.camera.backend = "replay";
  status.camera_report.damage_reason = "/frames/7.jpg: the payload is empty";
  EXPECT_EQ(advice(status),
            "The camera gives no usable frames. All that come are damaged (/frames/7.jpg: the "
            "payload is empty): play a recording that is whole.");
}

TEST(Advice, SaysHowFarTheCameraHasMovedOnlyWhileItHas) {
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.camera_shift_message = "They are about 4 px right and 2 px up of there.";
  EXPECT_EQ(advice(status), "");
  status.health.set(Health::camera_shifted);
  EXPECT_THAT(advice(status), EndsWith("calibrate again. " + status.camera_shift_message));
}

TEST(Advice, NamesBothRatesOfASlowCamera) {
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.camera.fps = 60;
  status.camera_fps = 30.04;
  EXPECT_EQ(advice(status), "");
  status.health.set(Health::camera_slow);
  EXPECT_THAT(advice(status), StartsWith("The camera takes fewer frames than its mode promises"));
  EXPECT_THAT(advice(status), EndsWith("30.0 come in a second instead of 60."));
}

// Waiting does not help in the dark.
TEST(Advice, SaysWhatToCheckInADarkPictureInsteadOfStartingUp) {
  for (const Health waits : {Health::starting, Health::light_unsettled}) {
    pipeline::Status status;
    status.health.set(waits);
    status.health.set(Health::image_dark);
    EXPECT_THAT(advice(status),
                StartsWith("The picture is too dark to measure in: check the ring's "
                           "power and wiring"));
    EXPECT_THAT(advice(status), Not(HasSubstr("keep the surface free")));
    EXPECT_EQ(fix(status, waits), "It waits for a picture that is bright enough.");
  }
}

TEST(Advice, EndsWithWhatCouldNotBeKept) {
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.storage_message = "The reference could not be written: free some space.";
  EXPECT_EQ(advice(status), "The reference could not be written: free some space.");
}

}  // namespace
}  // namespace dtact::net
