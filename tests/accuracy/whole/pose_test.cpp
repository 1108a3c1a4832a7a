// Objects that move on the simulated sensor, followed through the whole program with a calibration
// that its programs made: the short form of pose.md.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "clients/perceive/frame_maker.hpp"
#include "hal/sim/scene.hpp"
#include "hal/sim/truth.hpp"
#include "tests/accuracy/whole/moving_objects.hpp"
#include "tests/accuracy/whole/pose_track.hpp"
#include "tests/accuracy/whole/sequence.hpp"

namespace dtact::whole {
namespace {

using hal::sim::PressKey;

/// A calibration from one press of a ball, made once for all tests of this build.
std::filesystem::path calibration() {
  std::filesystem::path folder = DTACT_BUILD_DIR "/calibrations/one_press";
  const std::string command = fmt::format("{}/tests/accuracy/whole/calibrate.sh {} one_press {}",
                                          DTACT_SOURCE_DIR, DTACT_BUILD_DIR, folder.string());
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  return folder;
}

/// An object, its motion within a second, and the largest error allowed in any frame.
struct Case {
  const char* object;
  ObjectMotion motion;
  double mm;
  double deg;
};
void PrintTo(const Case& tested, std::ostream* out) {
  *out << tested.object << " " << tested.motion.name;
}

class MovingObjectIsFollowed : public testing::TestWithParam<Case> {};

TEST_P(MovingObjectIsFollowed, ThroughTheWholeProgram) {
  const Case& tested = GetParam();
  const auto* const object =
      std::ranges::find(kMovingObjects, std::string(tested.object), &MovingObject::name);
  ASSERT_NE(object, kMovingObjects.end());
  hal::sim::Scene scene = hal::sim::parse_scene(
      fmt::format("[[press]]\n{}\nkeys = [{{ t = 0.0 }}]\n", object->lines), object->name);
  const std::vector<MotionFrames> choreography = choreograph(*object, {&tested.motion, 1}, scene);
  const std::vector<std::vector<ShapeRow>> shapes(1);
  std::vector<Sequence> recorded;
  record(std::make_shared<const hal::sim::Truth>(scene), calibration(), *object,
         {&tested.motion, 1}, choreography, shapes,
         [&](const Sequence& sequence) { recorded.push_back(sequence); });
  const Sequence& sequence = recorded.at(0);
  perceive::FrameMaker maker;
  const std::vector<TrackRow> track = perceive_track(sequence.frames, maker);
  PoseError worst;
  for (std::size_t i = sequence.begin(); i < track.size(); ++i) {
    ASSERT_TRUE(track[i].usable) << "lost in frame " << i - sequence.begin() << " of the motion";
    const PoseError error = motion_errors(sequence, track, track[i]).reported;
    worst = {std::max(worst.mm, error.mm), std::max(worst.deg, error.deg)};
  }
  fmt::print("{}: at most {:.3f} mm and {:.2f} degrees off, {} directions unobservable\n",
             sequence.name, worst.mm, worst.deg, track.back().unobservable.size());
  EXPECT_LE(worst.mm, tested.mm);
  EXPECT_LE(worst.deg, tested.deg);
}

constexpr ObjectMotion kTurn{"turn", 1,
                             [](double part) { return PressKey{.rotation_deg = 20 * part}; }};
constexpr ObjectMotion kSlide{
    "slide", 1, [](double part) { return PressKey{.x_mm = 1.8 * part, .y_mm = 0.9 * part}; }};
constexpr ObjectMotion kTurnAndSlide{"turn_and_slide", 1, [](double part) {
                                       return PressKey{.x_mm = -0.6 * part,
                                                       .y_mm = 1.3 * part,
                                                       .rotation_deg = -20 * part,
                                                       .tilt_x_deg = 3 * part};
                                     }};

// Only the nut's chamfer shows its rotation.
INSTANTIATE_TEST_SUITE_P(Objects, MovingObjectIsFollowed,
                         testing::Values(Case{"m3_long_nut", kTurn, 0.05, 0.5},
                                         Case{"cube", kSlide, 0.05, 0.5},
                                         Case{"m4_nut", kTurnAndSlide, 0.1, 3},
                                         Case{"key", kSlide, 0.05, 0.5},
                                         Case{"ball_array", kTurn, 0.05, 0.5}),
                         [](const auto& tested) { return std::string(tested.param.object); });

}  // namespace
}  // namespace dtact::whole
