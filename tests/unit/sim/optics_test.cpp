#include "hal/sim/optics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "hal/sim/truth.hpp"
#include "tests/unit/sim/small_scene.hpp"

namespace dtact::hal::sim {
namespace {

constexpr int kN = 200;
constexpr std::size_t kPoints = 40000;  // kN²

constexpr std::size_t at(int x, int y) {
  return static_cast<std::size_t>(y) * kN + static_cast<std::size_t>(x);
}

const Grid kGrid = {kN, kN, 0.125, -12.5, -12.5};

OpticsModel model() {
  OpticsModel optics;
  optics.pressed_slope = 0.2;
  optics.pressed_curve = -0.02;
  optics.bulged_slope = 0.6;
  optics.bulged_curve = -1.0;
  optics.narrow_mm = 0.3;
  optics.wide_mm = 1.8;
  optics.narrow_weight = 0.7;
  return optics;
}

TEST(Optics, ResponseHasTwoSides) {
  EXPECT_DOUBLE_EQ(response(model(), 1.0), 0.18);
  EXPECT_DOUBLE_EQ(response(model(), -0.2), -0.16);
  EXPECT_DOUBLE_EQ(response(model(), 0.0), 0.0);
}

TEST(Optics, EvenIndentationIsNotChangedByScattering) {
  Optics optics(model(), kGrid);
  const std::vector<std::int16_t> indentation(kPoints, Truth::kPerMm);  // 1 mm
  std::vector<std::int16_t> loss(kPoints);
  optics.run(indentation, loss);
  for (const std::int16_t value : loss) ASSERT_NEAR(value, 0.18 * 32768, 2);
}

TEST(Optics, AThickerSideDarkensLess) {
  OpticsModel linear = model();
  linear.pressed_curve = 0;
  linear.narrow_weight = 1;
  GelModel gel;
  gel.taper_x = 0.02;
  Optics optics(linear, kGrid, gel);
  const std::vector<std::int16_t> indentation(kPoints, Truth::kPerMm);  // 1 mm
  std::vector<std::int16_t> loss(kPoints);
  optics.run(indentation, loss);
  // 10 mm to the left and to the right the gel is 0.8 and 1.2 of its mean.
  EXPECT_NEAR(loss[at(20, 100)], 0.2 / 0.8 * 32768, 10);
  EXPECT_NEAR(loss[at(100, 20)], 0.2 * 32768, 10);
  EXPECT_NEAR(loss[at(180, 100)], 0.2 / 1.2 * 32768, 10);
}

TEST(Optics, ScatteringKeepsTheSumAndHasTheTwoWidths) {
  Optics optics(model(), kGrid);
  std::vector<std::int16_t> indentation(kPoints, 0);
  std::vector<std::int16_t> loss(kPoints);
  for (int y = 96; y < 104; ++y) {
    for (int x = 96; x < 104; ++x) indentation[at(x, y)] = 16000;
  }
  optics.run(indentation, loss);
  // 64 points of 2 mm: 0.4 − 0.08 = 0.32 of the light each.
  const double sum = std::accumulate(loss.begin(), loss.end(), 0.0);
  EXPECT_NEAR(sum / (64 * 0.32 * 32768), 1, 0.01);
  // Variance across: 0.7·0.3² + 0.3·1.8² mm², and (1 mm)²/12 of the square itself.
  double variance = 0;
  for (int y = 0; y < kN; ++y) {
    for (int x = 0; x < kN; ++x) {
      variance += loss[at(x, y)] * std::pow((x - 99.5) * 0.125, 2);
    }
  }
  EXPECT_NEAR(variance / sum, 0.063 + 0.972 + 0.0833, 0.06);
}

TEST(Optics, WithoutScatteringItIsTheResponse) {
  OpticsModel sharp = model();
  sharp.narrow_mm = 0;
  sharp.narrow_weight = 1;
  Optics optics(sharp, kGrid);
  std::vector<std::int16_t> indentation(kPoints, 0);
  std::vector<std::int16_t> loss(kPoints);
  indentation[kN * 50 + 50] = 8000;
  indentation[kN * 60 + 50] = -1600;
  optics.run(indentation, loss);
  EXPECT_NEAR(loss[kN * 50 + 50], 0.18 * 32768, 1);
  EXPECT_NEAR(loss[kN * 60 + 50], -0.16 * 32768, 1);
  EXPECT_EQ(loss[kN * 50 + 51], 0);
}

TEST(Optics, AResponseByKnotsIsTheIntegralOfItsSlopes) {
  OpticsModel optics;
  optics.knots = {-0.2, 0, 0.5};
  optics.slopes = {1.2, 0.4, 0.6};
  // 2 mm thick: 1 mm is half of it, (0.4 + 0.6)/2 · 0.5; beyond the last knot the slope stays.
  EXPECT_NEAR(response(optics, 1.0, 2.0), 0.25, 1e-12);
  EXPECT_NEAR(response(optics, 1.4, 2.0), 0.25 + 0.6 * 0.2, 1e-12);
  EXPECT_NEAR(response(optics, -0.4, 2.0), -0.16, 1e-12);  // (1.2 + 0.4)/2 · 0.2
  EXPECT_NEAR(response(optics, -0.6, 2.0), -0.16 - 1.2 * 0.1, 1e-12);
  EXPECT_DOUBLE_EQ(response(optics, 0.0, 2.0), 0.0);
}

// The variance across of the light that is lost around a small square, less the square's own; the
// square is 8 points wide.
double variance_of(const OpticsModel& optics, std::int16_t indentation_of_square) {
  GelModel gel;
  gel.thickness_mm = 4.0;
  Optics chain(optics, kGrid, gel);
  std::vector<std::int16_t> indentation(kPoints, 0);
  std::vector<std::int16_t> loss(kPoints);
  for (int y = 96; y < 104; ++y) {
    for (int x = 96; x < 104; ++x) indentation[at(x, y)] = indentation_of_square;
  }
  chain.run(indentation, loss);
  const double sum = std::accumulate(loss.begin(), loss.end(), 0.0);
  double variance = 0;
  for (int y = 0; y < kN; ++y) {
    for (int x = 0; x < kN; ++x) variance += loss[at(x, y)] * std::pow((x - 99.5) * 0.125, 2);
  }
  return variance / sum - 0.0833;
}

TEST(Optics, AThirdWidthHasItsShare) {
  OpticsModel optics = model();
  optics.wide_mm = 1.0;
  optics.far_mm = 2.0;
  optics.far_weight = 0.1;
  // 0.7·0.3² + 0.2·1² + 0.1·2² mm²
  EXPECT_NEAR(variance_of(optics, 16000), 0.663, 0.05);
}

TEST(Optics, WidthsFollowTheLocalThickness) {
  OpticsModel optics = model();
  optics.pressed_curve = 0;
  optics.narrow_mm = 1.0;
  optics.narrow_weight = 1;
  optics.growth = 1;
  // 1.6 mm of 4 leave 0.6 of the thickness; widths are kept only there.
  EXPECT_NEAR(variance_of(optics, 12800), 0.36, 0.02);
  // 0.8 mm: half of the light goes 1 mm wide, half 0.6.
  EXPECT_NEAR(variance_of(optics, 6400), 0.5 * (1 + 0.36), 0.02);
  optics.growth = 0;
  EXPECT_NEAR(variance_of(optics, 12800), 1.0, 0.02);
}

TEST(Optics, SharingOutBetweenThicknessesLosesNoLight) {
  OpticsModel optics = model();
  optics.growth = 1;
  GelModel gel;
  gel.thickness_mm = 2.0;
  Optics chain(optics, kGrid, gel);
  const std::vector<std::int16_t> indentation(kPoints, 5600);  // 0.7 mm: 0.65 of the thickness
  std::vector<std::int16_t> loss(kPoints);
  chain.run(indentation, loss);
  for (const std::int16_t value : loss) ASSERT_NEAR(value, 0.1302 * 32768, 4);
}

TEST(Optics, BuiltInResponseRises) {
  const Scene scene = default_scene();
  double last = -1;
  for (int um = -400; um <= 1800; um += 10) {
    const double d = um / 1000.0;
    const double now = response(scene.optics, d);
    ASSERT_GT(now, last) << d;
    last = now;
  }
}

}  // namespace
}  // namespace dtact::hal::sim
