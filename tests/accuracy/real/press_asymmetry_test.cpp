// The press's own gain on real ball presses: parts that a fit did not see read better with it, and
// the zero of the LUT depends less on the choice of pixels.
#include "clients/calibrate/fit/press_asymmetry.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "clients/calibrate/fit/lut_fit.hpp"
#include "tests/accuracy/real/ball_press.hpp"

namespace dtact::calibration {
namespace {

struct Expected {
  const char* sensor;
  double mm_per_px;
  AsymmetryOrder order;
  double sectors_mm;  ///< Left-out error, at most.
  double reach_mm;    ///< Limit of the zeros' difference with the reach,
  double start_mm;    ///< … with the centre at which the fit starts,
  double sector_mm;   ///< … with the sectors used for fitting.
};

class RealPressAsymmetry : public testing::TestWithParam<Expected> {
 protected:
  void SetUp() override {
    const auto folder = sensor_folder(GetParam().sensor);
    if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
    press_ = ball_press(load_pair(*folder, "ball"), GetParam().mm_per_px);
    const Calibration empty = empty_calibration(press_.reference_q8, {}, press_.mm_per_px, {});
    settled_ = settle(*empty.model, press_.reference_q8.pixels, press_.frames, 4);
  }

  /// Zero of the press, its gain fitted about `start` to the pixels `use`.
  [[nodiscard]] double zero(const Contact& start, AsymmetryOrder order, const PixelFilter& use,
                            double reach = 0.9) const {
    const PressAsymmetry gain = fit_asymmetry(sure_samples(settled_.map, start, use), 4, order);
    SymmetricPress level = without_asymmetry(settled_.map, start, gain);
    level.contact.radius_mm *= reach / 0.9;  // fit_sag() uses nine tenths of it
    return fit_sag(level.map, level.contact, use).depth_mm;
  }
  [[nodiscard]] std::vector<double> by_reach(AsymmetryOrder order) const {
    std::vector<double> zeros;
    for (const double reach : {0.85, 0.9, 0.95}) {
      zeros.push_back(zero(settled_.contact, order, {}, reach));
    }
    return zeros;
  }
  [[nodiscard]] std::vector<double> by_start(AsymmetryOrder order) const {
    std::vector<double> zeros;
    for (const auto& [right, down] : {std::pair{0.1, 0.0}, {-0.1, 0.0}, {0.0, 0.1}, {0.0, -0.1}}) {
      Contact start = settled_.contact;
      start.col += right / press_.mm_per_px;
      start.row += down / press_.mm_per_px;
      zeros.push_back(zero(start, order, {}));
    }
    return zeros;
  }
  [[nodiscard]] std::vector<double> by_sector(AsymmetryOrder order) const {
    std::vector<double> zeros;
    const Contact& contact = settled_.contact;
    for (const double turned : {0.0, 22.5}) {
      for (const bool even : {true, false}) {
        zeros.push_back(zero(contact, order, [&](int x, int y) {
          return in_even_sector(x - contact.col, y - contact.row, 45, turned) == even;
        }));
      }
    }
    return zeros;
  }

  BallPress press_;
  SettledPress settled_;
};

double apart(const char* what, const std::vector<double>& zeros) {
  const auto [least, most] = std::ranges::minmax(zeros);
  fmt::print("zero {}: {:.3f} to {:.3f} mm\n", what, least, most);
  return most - least;
}

TEST_P(RealPressAsymmetry, IsChosenAndLowersTheErrorOfWhatWasLeftOut) {
  const Calibration made = build(press_);
  const Evaluation e = evaluate(made, press_.reference_q8.pixels, press_.frames, 4);
  fmt::print("{}: half-disc {:.4f} mm, sectors {:.4f} mm\n{}\n", GetParam().sensor,
             e.half_mae_mm.value_or(1), e.sector_mae_mm.value_or(1), e.press_asymmetry.describe());
  EXPECT_EQ(e.press_asymmetry.gain.order, GetParam().order);
  EXPECT_LE(e.sector_mae_mm.value_or(1), GetParam().sectors_mm);
}

TEST_P(RealPressAsymmetry, TheZeroHangsLittleOnReachStartAndSector) {
  const AsymmetryOrder order = GetParam().order;
  EXPECT_LE(apart("by reach", by_reach(order)), GetParam().reach_mm);
  EXPECT_LE(apart("by start", by_start(order)), GetParam().start_mm);
  EXPECT_LE(apart("by sector", by_sector(order)), GetParam().sector_mm);
  apart("by reach, without a gain", by_reach(AsymmetryOrder::none));
  apart("by start, without a gain", by_start(AsymmetryOrder::none));
  apart("by sector, without a gain", by_sector(AsymmetryOrder::none));
}

// The goal for the zero is 0.03 mm; sensor_b's asymmetric press, without its lens, misses it with
// reach.
INSTANTIATE_TEST_SUITE_P(Sensors, RealPressAsymmetry,
                         testing::Values(Expected{"sensor_a", 0.0510, AsymmetryOrder::quadratic,
                                                  0.0135, 0.03, 0.03, 0.03},
                                         Expected{"sensor_b", 0.05317, AsymmetryOrder::quadratic,
                                                  0.05, 0.04, 0.03, 0.03}),
                         [](const auto& expected) { return std::string(expected.param.sensor); });

}  // namespace
}  // namespace dtact::calibration
