// Recognition of simulated presses that training did not have, and of presses of real sensors.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "clients/calibrate/fit/darkening_map.hpp"
#include "clients/calibrate/fit/model/auto_build.hpp"
#include "clients/perceive/recognition/recogniser.hpp"
#include "tests/accuracy/real/press_images.hpp"
#include "tests/recognition/objects.hpp"
#include "tests/recognition/presses.hpp"

namespace dtact::recognition {
namespace {

using perceive::Evidence;
using perceive::Network;
using perceive::Recognised;
using perceive::TouchMap;
using perceive::Verdict;

/// Of presses at least 0.3 mm deep and not cut off.
constexpr double kMinRight = 0.9;

std::size_t best_of(const perceive::Probabilities& p) {
  return static_cast<std::size_t>(std::max_element(p.begin(), p.end() - 1) - p.begin());
}

TEST(Recognition, NamesFreshPressesOnSensorsNotSeenInTraining) {
  Network network;
  int right = 0;
  int all = 0;
  int unknown = 0;
  int others = 0;
  for (int sensor = 0; sensor < 2; ++sensor) {
    Wanted wanted{.seed = 900, .sensor = sensor, .presses = 60, .object = [](whole::Draw& draw) {
                    const bool known = draw.chance(0.75);
                    const int kinds_in_all = static_cast<int>(kinds().size());
                    return std::pair{
                        known ? draw.index(kClasses) : draw.between(kClasses, kinds_in_all - 1),
                        draw.index(8)};
                  }};
    ASSERT_TRUE(make_presses(wanted, [&](const Press& press, const TouchMap& map, const auto&) {
      if (map.deepest_mm < 0.3 || map.cut > 1) return;
      const auto output = network.run(map);
      if (press.kind < kClasses) {
        ++all;
        right += best_of(output.probabilities) == static_cast<std::size_t>(press.kind) ? 1 : 0;
      } else {
        ++others;
        unknown += output.probabilities.back() > 0.5 ? 1 : 0;
      }
    }));
  }
  fmt::print("{} of {} named rightly, {} of {} other shapes unknown\n", right, all, unknown,
             others);
  EXPECT_GT(all, 50);
  EXPECT_GE(right, kMinRight * all);
}

/// A calibration by the sensor's own ball press, in the published field.
recon::Model calibrated(const PressImages& images, const char* sensor) {
  const bool a = sensor == std::string("sensor_a");
  calibration::BallPresses set;
  set.reference_q8 = {images.reference.cols, images.reference.rows, {}};
  for (const float level : images.reference) {
    set.reference_q8.pixels.push_back(static_cast<std::uint16_t>(std::lround(256 * level)));
  }
  image::Grey8 frame{images.frame.cols, images.frame.rows, {}};
  for (const float level : images.frame) {
    frame.pixels.push_back(static_cast<std::uint8_t>(std::lround(level)));
  }
  set.presses.push_back({"ball", {frame}, {}});
  set.ball_radius_mm = 4;
  set.mm_per_px = a ? 0.05102 : 0.05317;
  const int row = a ? 240 : 236;
  set.crop = calibration::Crop{327 - 230, row - 172, 460, 345};
  calibration::PressReport report;
  return *calibration::build_auto(set, {}, report).model;
}

TouchMap touch_of(const PressImages& images, const recon::Model& model) {
  std::vector<std::uint16_t> reference;
  for (const float level : images.reference) {
    reference.push_back(static_cast<std::uint16_t>(std::lround(256 * level)));
  }
  image::Grey8 frame{images.frame.cols, images.frame.rows, {}};
  for (const float level : images.frame) {
    frame.pixels.push_back(static_cast<std::uint8_t>(std::lround(level)));
  }
  calibration::DepthReader reader(std::make_shared<const recon::Model>(model));
  reader.set_reference(reference);
  perceive::DepthGrid grid;
  grid.width = grid.full_width = model.rectify.width;
  grid.height = grid.full_height = model.rectify.height;
  grid.mm_per_px = model.mm_per_px;
  grid.untrusted = recon::kUntrusted;
  grid.values = reader.read(frame);
  return perceive::touch_map(grid);
}

TEST(Recognition, RealBallsAreBallsAndPinBoardsUnknown) {
  if (!sensor_folder("sensor_a")) GTEST_SKIP() << "the real images are not beside the repository";
  Network network;
  const auto judge = [&](const char* sensor, const char* object, const char* calibration) {
    const auto model = calibrated(load_pair(*sensor_folder(calibration), "ball"), calibration);
    const TouchMap map = touch_of(load_pair(*sensor_folder(sensor), object), model);
    const auto output = network.run(map);
    Evidence evidence;
    evidence.add(map, output);
    const Recognised found = evidence.result(1);
    const std::size_t best = best_of(found.probabilities);
    fmt::print("{} {}: {:.2f} mm deep, verdict {}, {} {:.3f}, another shape {:.3f}\n", sensor,
               object, map.deepest_mm, static_cast<int>(found.verdict),
               perceive::kClassNames.at(best), found.probabilities.at(best),
               found.probabilities.back());
    return found;
  };
  for (const char* sensor : {"sensor_a", "sensor_b"}) {
    const Recognised ball = judge(sensor, "ball", sensor);
    EXPECT_EQ(ball.verdict, Verdict::known) << sensor;
    EXPECT_EQ(best_of(ball.probabilities), 0U) << sensor;
    EXPECT_EQ(judge(sensor, "board", sensor).verdict, Verdict::unknown) << sensor;
  }
  // It has no ball press of its own.
  EXPECT_EQ(judge("sensor_c", "board", "sensor_b").verdict, Verdict::unknown);
}

}  // namespace
}  // namespace dtact::recognition
