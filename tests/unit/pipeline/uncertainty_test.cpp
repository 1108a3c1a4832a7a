#include "daemon/pipeline/depth/uncertainty.hpp"

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <vector>

#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/recon/depth_sums.hpp"
#include "daemon/recon/model.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

constexpr int kSide = 96;

template <typename Depth>
double bend_of(Depth depth, double mm_per_px) {
  std::vector<std::int16_t> map;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) map.push_back(static_cast<std::int16_t>(depth(x, y)));
  }
  const recon::TileGrid grid(kSide, kSide);
  const recon::TileRows all(static_cast<std::size_t>(grid.rows()), grid.all());
  recon::DepthSums sums({.bend_reach = bend_reach(mm_per_px), .bend_from_um = 100});
  recon::StripSums strips(grid, all, map.data(), sums);
  for (int row = 0; row < grid.rows(); ++row) strips.finished(row);
  return bend_um(sums, mm_per_px);
}

TEST(Bend, PlanesHaveNone) {
  EXPECT_EQ(bend_of([](int, int) { return 500; }, 0.0415), 0);
  EXPECT_EQ(bend_of([](int x, int y) { return 500 + 3 * x + 2 * y; }, 0.0415), 0);
}

TEST(Bend, AParabolaHasTheSameWhereverAndHoweverFine) {
  // 2 x² µm at 0.0415 mm a pixel: the second difference over ±4 pixels (0.166 mm) is 64 µm, halved.
  EXPECT_NEAR(bend_of([](int x, int) { return 200 + 2 * (x - 48) * (x - 48); }, 0.0415), 32, 0.1);
  // At 0.166 mm a pixel the second difference is 4 µm, halved.
  EXPECT_NEAR(bend_of([](int x, int) { return 200 + 2 * (x - 48) * (x - 48); }, 0.166), 2, 0.1);
}

TEST(Bend, OnlyPressedAndTrustedPixelsCount) {
  EXPECT_EQ(bend_of([](int x, int) { return x % 2 == 0 ? 99 : -400; }, 0.166), 0);
  EXPECT_EQ(bend_of([](int x, int) { return x % 2 == 0 ? 500 : int{recon::kUntrusted}; }, 0.166),
            0);
}

TEST(Bend, LooksAtEveryFourthRowOfAFullMapAndEveryRowOfAQuarterMap) {
  const auto rows_seen = [](double mm_per_px) {
    std::vector<int> seen;
    for (int row = 0; row < 24; ++row) {
      // A plane with one row that is not in it.
      if (bend_of([row](int, int y) { return y == row ? 500 : 0; }, mm_per_px) > 0)
        seen.push_back(row);
    }
    return seen;
  };
  EXPECT_EQ(rows_seen(0.0415), (std::vector<int>{4, 8, 12, 16, 20}));  // reach of 4 pixels
  EXPECT_EQ(rows_seen(0.083), (std::vector<int>{2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22}));
  EXPECT_EQ(rows_seen(0.166).size(), 23U);  // all but row 0: reach of 1 pixel
  EXPECT_EQ(rows_seen(0.0277), (std::vector<int>{6, 10, 14, 18, 22}));  // reach of 6 pixels
}

TEST(Bend, IsZeroWhereNothingWasAddedUp) {
  EXPECT_EQ(bend_um(recon::DepthSums({.bend_reach = 4}), 0.0415), 0);
}

TEST(Bend, ReachIsASixthOfAMillimetreAndAtLeastOnePixel) {
  EXPECT_EQ(bend_reach(0.0415), 4);
  EXPECT_EQ(bend_reach(0.083), 2);
  EXPECT_EQ(bend_reach(0.166), 1);
  EXPECT_EQ(bend_reach(0.5), 1);
}

TEST(Uncertainty, RimOfWhatIsTooDeepBendsMoreThanIsSeen) {
  EXPECT_DOUBLE_EQ(rim_factor(500, 0), 1);
  EXPECT_DOUBLE_EQ(rim_factor(400, 500), 1.5);
  EXPECT_DOUBLE_EQ(rim_factor(0, 700), 1);
}

TEST(Uncertainty, AddsLutAndBlurInSquares) {
  EXPECT_DOUBLE_EQ(uncertainty_um(30, 0), 30);
  EXPECT_DOUBLE_EQ(uncertainty_um(28, 3), 35);  // √(28² + 21²)
  EXPECT_DOUBLE_EQ(uncertainty_at_um(30, 0, 4), 30);
  EXPECT_DOUBLE_EQ(uncertainty_at_um(28, 3, 4), 35.93);
}

/// The uncertainty of a LUT at 0.5 mm after a change to its model.
template <typename Change>
double lut_um(Change change) {
  const auto calibration = fakes::toy_calibration();
  recon::Model model = *calibration->model;
  change(model);
  calibration->model = std::make_shared<const recon::Model>(std::move(model));
  hal::CameraInfo camera;
  camera.width = fakes::kToyWidth;
  camera.height = fakes::kToyHeight;
  return activate(calibration, camera, {})->maps.lut_um(0.5, 0);
}

TEST(LutUncertainty, IsTheCalibrationsBetweenItsRows) {
  EXPECT_DOUBLE_EQ(
      lut_um([](recon::Model& m) { m.uncertainty = {{.depth_mm = 0.4, .error_um = 30}}; }), 30);
  EXPECT_DOUBLE_EQ(lut_um([](recon::Model& m) {
                     m.uncertainty = {{.depth_mm = 0.4, .error_um = 30},
                                      {.depth_mm = 0.8, .error_um = 70}};
                   }),
                   40);
}

TEST(LutUncertainty, HoldsBeyondBothEndsOfItsRows) {
  EXPECT_DOUBLE_EQ(lut_um([](recon::Model& m) {
                     m.uncertainty = {{.depth_mm = 0.6, .error_um = 30},
                                      {.depth_mm = 0.8, .error_um = 70}};
                   }),
                   30);
  EXPECT_DOUBLE_EQ(lut_um([](recon::Model& m) {
                     m.uncertainty = {{.depth_mm = 0.2, .error_um = 30},
                                      {.depth_mm = 0.4, .error_um = 70}};
                   }),
                   70);
}

TEST(LutUncertainty, OfACalibrationThatDoesNotSayIsWhatTheTableMeasured) {
  EXPECT_EQ(lut_um([](recon::Model&) {}), 50);
  EXPECT_EQ(lut_um([](recon::Model& m) { m.method = recon::Method::published; }), 118);
  EXPECT_EQ(lut_um([](recon::Model& m) { m.gain.shape = recon::GainShape::radial; }), 118);
}

/// The ladder of plain resolutions, chosen by a frame's expected error from its LUT and bend.
class LadderChooser {
 public:
  int next(double lut_um, double bend_um) {
    std::array<double, 3> expected{};
    for (std::size_t i = 0; i < 3; ++i) {
      expected[i] = uncertainty_at_um(lut_um, bend_um, kDecimations[i]);
    }
    return kDecimations[chooser_.next(expected)];
  }

 private:
  static constexpr std::array<int, 3> kDecimations{4, 2, 1};
  ResolutionChooser chooser_{50};
};

TEST(ResolutionChooser, GoesFinerAtOnceAndCoarserWithPatience) {
  LadderChooser chooser;
  EXPECT_EQ(chooser.next(20, 0), 4);
  EXPECT_EQ(chooser.next(20, 6.4), 2);  // √(20² + 44.8²) = 49.06; + 0.54 at half, + 1.98 at quarter
  for (int i = 1; i < ResolutionChooser::kPatience; ++i) EXPECT_NE(chooser.next(20, 1), 4) << i;
  int frames = 0;
  while (chooser.next(20, 1) != 4) ASSERT_LT(++frames, 3 * ResolutionChooser::kPatience);
}

TEST(ResolutionChooser, PatienceBeginsAnewAfterEveryFrameThatIsNotWellInside) {
  LadderChooser chooser;
  ASSERT_EQ(chooser.next(20, 6.4), 2);
  for (int round = 0; round < 3; ++round) {
    for (int i = 1; i < 15; ++i) ASSERT_EQ(chooser.next(20, 1), 2) << round << ", frame " << i;
    ASSERT_EQ(chooser.next(20, 6.4), 2);  // fits half resolution, not a quarter
  }
  for (int i = 1; i < 15; ++i) ASSERT_EQ(chooser.next(20, 1), 2) << i;
  EXPECT_EQ(chooser.next(20, 1), 4);
  ASSERT_EQ(chooser.next(20, 6.4), 2);  // and after a step
  for (int i = 1; i < 15; ++i) ASSERT_EQ(chooser.next(20, 1), 2) << i;
  EXPECT_EQ(chooser.next(20, 1), 4);
}

TEST(ResolutionChooser, GoesOneStepCoarserAfterFifteenFramesEach) {
  LadderChooser chooser;
  ASSERT_EQ(chooser.next(60, 0), 1);
  std::vector<int> chosen;
  for (int i = 0; i < 31; ++i) chosen.push_back(chooser.next(20, 1));
  std::vector<int> expected(14, 1);
  expected.insert(expected.end(), 15, 2);
  expected.insert(expected.end(), 2, 4);
  EXPECT_EQ(chosen, expected);
}

TEST(ResolutionChooser, TakesFullResolutionWhereNothingIsInside) {
  LadderChooser chooser;
  EXPECT_EQ(chooser.next(60, 0), 1);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(chooser.next(60, 0), 1);
}

TEST(ResolutionChooser, DoesNotSwingAtTheBound) {
  // At quarter resolution just outside, at half just inside: never inside by the margin.
  LadderChooser chooser;
  const int first = chooser.next(20, 6.3);
  for (int i = 0; i < 200; ++i) EXPECT_EQ(chooser.next(20, 6.3), first);
}

TEST(ResolutionChooser, TakesTheLeastWrongWhereNothingIsInside) {
  ResolutionChooser chooser(50);
  EXPECT_EQ(chooser.next(std::array{80.0, 60.0, 70.0}), 1U);
  EXPECT_EQ(chooser.next(std::array{80.0, 70.0, 60.0}), 2U);
  EXPECT_EQ(chooser.next(std::array{60.0, 70.0, 80.0}), 0U);
  EXPECT_EQ(chooser.next(std::array{60.0, 40.0, 30.0}), 1U) << "the first that is inside";
}

TEST(Uncertainty, SharpeningLeavesLessOfTheBlurAndBendsMore) {
  EXPECT_EQ(plain_bend_um(5, 0), 5);
  EXPECT_EQ(uncertainty_at_um(28, 3, 4, 0), uncertainty_at_um(28, 3, 4));
  for (const int steps : {1, 2}) {
    EXPECT_LT(plain_bend_um(5, steps), plain_bend_um(5, steps - 1));
    EXPECT_LT(uncertainty_at_um(28, 3, 4, steps), uncertainty_at_um(28, 3, 4, steps - 1));
  }
}

}  // namespace
}  // namespace dtact::pipeline
