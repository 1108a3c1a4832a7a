#include "clients/ctl/hand_over.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace dtact::ctl {
namespace {

using testing::ElementsAre;

TEST(HandOver, CalibrateIsTheGuidedSessionUnlessItSaysWhich) {
  EXPECT_THAT(for_calibrate({"calibrate", "--radius-mm", "4", "--lens", "lens"}),
              ElementsAre("guided", "--radius-mm", "4", "--lens", "lens"));
  EXPECT_THAT(for_calibrate({"calibrate", "depth", "--ball", "guided"}),
              ElementsAre("depth", "--ball", "guided"));
  EXPECT_THAT(for_calibrate({"calibrate", "lens", "-o", "x"}), ElementsAre("lens", "-o", "x"));
  EXPECT_THAT(for_calibrate({"calibrate"}), ElementsAre("guided"));
  EXPECT_THAT(for_calibrate({"calibrate", "--help"}), ElementsAre("guided", "--help"));
}

TEST(HandOver, GlobalOptionsGoAlong) {
  EXPECT_THAT(for_calibrate({"--host", "calibrate", "--port", "7", "calibrate", "--json", "depth"}),
              ElementsAre("--host", "calibrate", "--port", "7", "--json", "depth"));
  EXPECT_THAT(for_calibrate({"calibrate", "--port", "7", "lens"}),
              ElementsAre("--port", "7", "lens"));
  EXPECT_THAT(for_calibrate({"--token-file", "calibrate", "--insecure", "--fingerprint", "lens",
                             "--ca-file", "depth", "calibrate", "depth"}),
              ElementsAre("--token-file", "calibrate", "--insecure", "--fingerprint", "lens",
                          "--ca-file", "depth", "depth"));
}

TEST(HandOver, OtherCommandsStayAsTheyAre) {
  EXPECT_THAT(for_calibrate({"evaluate", "--folder", "calibrate"}),
              ElementsAre("evaluate", "--folder", "calibrate"));
  EXPECT_THAT(for_calibrate({"apply", "--frame", "f.png"}),
              ElementsAre("apply", "--frame", "f.png"));
  EXPECT_THAT(for_calibrate({}), ElementsAre());
}

}  // namespace
}  // namespace dtact::ctl
