// The pins of real boards in images changed as in other sensors of the family.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <stdexcept>
#include <string>

#include "clients/calibrate/lens/pins.hpp"
#include "tests/accuracy/real/press_images.hpp"

namespace dtact::ctl {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class RobustPins : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const auto folder = sensor_folder(GetParam());
    if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
    board_ = load_pair(*folder, "board");
  }
  /// The pins are found, except for `faint` at the edge, and are where the grid says; each is
  /// judged by the lens of the others.
  static PinPress expect_found(const PressImages& board, const char* what, double bound_mm = 0.06,
                               std::size_t faint = 0) {
    const PinPress press = find_pins(board.reference, board.frame, {});
    const double error = rms(press.lens.left_out);
    fmt::print("{} {}: left-out RMS {:.4f} mm, {} parameters\n", GetParam(), what, error,
               parameters(press.lens.model));
    EXPECT_LE(error, bound_mm) << what;
    EXPECT_EQ(press.marks.size() + press.missing.size(), 63U) << what;
    EXPECT_LE(press.missing.size(), faint) << what;
    return press;
  }
  /// The pins of the board as it is, found once for each sensor.
  static const PinPress& expect_found_as_it_is(const PressImages& board) {
    static std::map<std::string, PinPress> all;
    const auto here = all.find(GetParam());
    if (here != all.end()) return here->second;
    return all.emplace(GetParam(), expect_found(board, "as it is")).first->second;
  }
  /// The pins darken the image by 8 levels only; some of those at the edge vanish in a leak of 30,
  /// which is reported.
  static bool has_faint_pins() { return GetParam() == std::string("sensor_c"); }
  PressImages board_;
};

TEST_P(RobustPins, AsTheyAre) { expect_found_as_it_is(board_); }
TEST_P(RobustPins, Everything) {
  expect_found(leaking(tilted(dark_corners(turned(board_)))), "all of them",
               has_faint_pins() ? 0.08 : 0.07, has_faint_pins() ? 3 : 0);
}

/// One change each, to tell which of them breaks Everything.
class RobustPinsOneChange : public RobustPins {};

TEST_P(RobustPinsOneChange, Portrait) {
  const PinPress press = expect_found(turned(board_), "portrait");
  EXPECT_EQ(press.rows, 9);
  EXPECT_EQ(press.cols, 7);
}
TEST_P(RobustPinsOneChange, DarkCorners) { expect_found(dark_corners(board_), "dark corners"); }
TEST_P(RobustPinsOneChange, Tilted) { expect_found(tilted(board_), "tilted"); }
TEST_P(RobustPinsOneChange, Leaking) { expect_found(leaking(board_), "leaking", 0.065, 3); }

TEST_P(RobustPins, NamesThePinsThatAreMissing) {
  const PinPress& whole = expect_found_as_it_is(board_);
  // The second row's third and the last row's last; half the pitch is about 25 pixels here.
  PressImages gone = board_;
  for (const std::size_t pin : {11U, 62U}) {
    const recon::Point px = whole.marks[pin].px;
    gone = without_pin(gone, {static_cast<int>(px.x), static_cast<int>(px.y)}, 27);
  }
  const PinPress press = find_pins(gone.reference, gone.frame, {});
  EXPECT_THAT(press.missing, testing::ElementsAre("row 2, column 3", "row 7, column 9"));
  EXPECT_LE(rms(press.lens.left_out), 0.06);
}

TEST_P(RobustPinsOneChange, AnUndeformedSurfaceIsNoBoard) {
  // Both images of one surface; the second with the noise of another exposure.
  cv::Mat1f frame = board_.reference.clone();
  cv::RNG random(1);
  for (float& level : frame) level += static_cast<float>(random.gaussian(1));
  EXPECT_THAT([&] { (void)find_pins(board_.reference, frame, {}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no lattice of 7x9 pins found")));
}

INSTANTIATE_TEST_SUITE_P(Sensors, RobustPins, testing::Values("sensor_a", "sensor_b", "sensor_c"),
                         [](const auto& sensor) { return std::string(sensor.param); });
INSTANTIATE_TEST_SUITE_P(FaintestPins, RobustPinsOneChange, testing::Values("sensor_c"));

}  // namespace
}  // namespace dtact::ctl
