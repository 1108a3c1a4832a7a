#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/pipeline/reference/contact_check.hpp"
#include "daemon/pipeline/reference/luma_grid.hpp"
#include "daemon/pipeline/reference/reference_average.hpp"
#include "daemon/pipeline/reference/reference_keeper.hpp"
#include "hal/files/png.hpp"
#include "tests/fakes/toy_sensor.hpp"

namespace dtact::pipeline {
namespace {

using fakes::toy_reference_q8;
using fakes::ToyScene;

TEST(Settle, NeedsTheWholeWindow) {
  SettleDetector settle({.settle_frames = 3, .settle_grey = 0.5});
  EXPECT_FALSE(settle.add(100.0F));
  EXPECT_FALSE(settle.add(100.0F));
  EXPECT_TRUE(settle.add(100.25F));
  settle.reset();
  EXPECT_FALSE(settle.add(100.0F));
}

TEST(Settle, WaitsWhileTheMeanMoves) {
  SettleDetector settle({.settle_frames = 3, .settle_grey = 0.5});
  for (int i = 0; i < 20; ++i) EXPECT_FALSE(settle.add(100.0F + 0.3F * static_cast<float>(i)));
  EXPECT_FALSE(settle.add(106.0F));
  EXPECT_TRUE(settle.add(106.0F));
}

TEST(Settle, RefusesImpossibleWindows) {
  EXPECT_THROW(SettleDetector({.settle_frames = 1}), std::invalid_argument);
  EXPECT_THROW(SettleDetector({.settle_frames = 65}), std::invalid_argument);
}

TEST(ReferenceAverage, KeepsTheFraction) {
  ReferenceAverage average(2, 1, 4);
  const std::vector<std::uint8_t> low = {10, 255};
  const std::vector<std::uint8_t> high = {11, 255};
  EXPECT_FALSE(average.add({low.data(), 2, 1, 2}));
  EXPECT_FALSE(average.add({low.data(), 2, 1, 2}));
  EXPECT_FALSE(average.add({low.data(), 2, 1, 2}));
  EXPECT_TRUE(average.add({high.data(), 2, 1, 2}));
  std::vector<std::uint16_t> q8(2);
  average.write(q8);
  EXPECT_EQ(q8, (std::vector<std::uint16_t>{2624, 65280}));  // 10.25 and 255
}

TEST(ReferenceAverage, HoldsItsMostFramesAndBeginsAnew) {
  ReferenceAverage average(1, 1, 256);
  const std::uint8_t white = 255;
  for (int i = 0; i < 255; ++i) EXPECT_FALSE(average.add({&white, 1, 1, 1}));
  EXPECT_TRUE(average.add({&white, 1, 1, 1}));
  std::vector<std::uint16_t> q8(1);
  average.write(q8);
  EXPECT_EQ(q8[0], 65280);
  average.reset();
  EXPECT_EQ(average.added(), 0);
  EXPECT_THROW(ReferenceAverage(1, 1, 257), std::invalid_argument);
  EXPECT_THROW(ReferenceAverage(1, 1, 0), std::invalid_argument);
}

TEST(LumaGrid, CellsAreMeans) {
  std::vector<std::uint8_t> pixels(std::size_t{80} * 60, 10);
  pixels[0] = 50;  // one of the first cell's four pixels
  LumaGrid grid;
  measure({pixels.data(), 80, 60, 80}, grid);
  EXPECT_FLOAT_EQ(grid.cells[0], 20);
  EXPECT_FLOAT_EQ(grid.cells[1], 10);
  EXPECT_NEAR(grid.mean, 10.0083, 1e-4);  // 10 + 10/1200
  LumaGrid other = grid;
  other.cells[kGridWidth + 1] = 13;
  EXPECT_FLOAT_EQ(greatest_change(grid, other, {}), 3);
  EXPECT_FLOAT_EQ(greatest_change(grid, other, {.x0 = 2}), 0);
}

TEST(LumaGrid, ReferencesAreMeasuredInGreyLevels) {
  const std::vector<std::uint16_t> q8(std::size_t{80} * 60, 2624);
  LumaGrid grid;
  measure(q8, 80, 60, grid);
  EXPECT_FLOAT_EQ(grid.cells[kGridCells - 1], 10.25F);
}

class ContactCheckTest : public ::testing::Test {
 protected:
  static LumaGrid grid_of(const ToyScene& scene) {
    LumaGrid grid;
    measure(toy_reference_q8(scene), fakes::kToyWidth, fakes::kToyHeight, grid);
    return grid;
  }
  float darkening(const ToyScene& now) {
    return check.compare(grid_of({}), grid_of(now), region, ContactCheck::kAnyShape, field)
        .darkening;
  }
  ContactCheck check;
  LightField field{};
  CellRegion region{.x0 = 2, .y0 = 2, .x1 = 38, .y1 = 28};
};

TEST_F(ContactCheckTest, LightIsNoContact) {
  EXPECT_LT(darkening({}), 0.001F);
  EXPECT_LT(darkening({.light = 0.5}), 0.001F);
  EXPECT_LT(darkening({.light = 1.3, .tilt = 0.3}), 0.001F);
}

TEST_F(ContactCheckTest, APressIsAContactUnderAnyLight) {
  // 31.25 of about 150 grey levels a millimetre, less the averaging over cells.
  EXPECT_NEAR(darkening({.press_mm = 1}), 0.2, 0.03);
  EXPECT_NEAR(darkening({.light = 0.5, .press_mm = 1}), 0.2, 0.03);
  EXPECT_GT(darkening({.light = 0.8, .tilt = -0.3, .press_mm = 0.15}), 0.02F);
}

TEST_F(ContactCheckTest, TheFitSeesTheLightThroughAPress) {
  (void)darkening({.light = 0.5, .press_mm = 1.5});
  EXPECT_NEAR(field[cell_at(20, 15)], 0.5, 0.02);  // under the press
  EXPECT_NEAR(field[cell_at(5, 5)], 0.5, 0.01);
}

TEST_F(ContactCheckTest, OneNumberSeesADimmedRingThroughALargePress) {
  const LumaGrid now = grid_of({.light = 0.5, .press_mm = 1.5});
  (void)check.compare(grid_of({}), now, region, ContactCheck::kSameShape, field);
  EXPECT_NEAR(field[cell_at(20, 15)], 0.5, 0.003);
  EXPECT_EQ(field[cell_at(20, 15)], field[0]);
}

TEST_F(ContactCheckTest, OneOddCellIsNoContactAndTwoAre) {
  LumaGrid now = grid_of({});
  now.cells[cell_at(20, 15)] *= 0.5F;
  EXPECT_LT(check.compare(grid_of({}), now, region, ContactCheck::kAnyShape, field).darkening,
            0.001F);
  now.cells[cell_at(21, 15)] *= 0.9F;
  EXPECT_NEAR(check.compare(grid_of({}), now, region, ContactCheck::kAnyShape, field).darkening,
              0.1F, 0.002F);
}

TEST(Relight, EndsAtWhite) {
  LightField field;
  field.fill(2);
  const std::vector<std::uint16_t> then(std::size_t{80} * 60, 200 * 256);
  std::vector<std::uint16_t> relit(then.size());
  relight(then, 80, 60, field, relit);
  EXPECT_EQ(relit.front(), 65280);
  EXPECT_EQ(relit.back(), 65280);
}

TEST_F(ContactCheckTest, RelightingBringsAReferenceToTheLightOfNow) {
  (void)darkening({.light = 0.7, .tilt = 0.2});
  const auto then = toy_reference_q8();
  const auto now = toy_reference_q8({.light = 0.7, .tilt = 0.2});
  std::vector<std::uint16_t> relit(then.size());
  relight(then, fakes::kToyWidth, fakes::kToyHeight, field, relit);
  for (std::size_t x = 8; x < 152; ++x) {  // the calibrated part of one row
    const std::size_t i = std::size_t{20} * fakes::kToyWidth + x;
    ASSERT_NEAR(relit[i], now[i], 64) << i;  // a quarter of a grey level
  }
}

/// Real images (640×480, one sensor each): two references taken at different times must agree, and
/// every press must differ.
struct RealPair {
  const char* folder;
  const char* then;
  const char* now;
  bool in_contact;
};

class RealTouch : public ::testing::TestWithParam<RealPair> {};

TEST_P(RealTouch, IsReportedFromDrift) {
  const RealPair& pair = GetParam();
  const std::filesystem::path folder =
      std::filesystem::path(DTACT_SHARED_DIR) / "data" / pair.folder;
  if (!std::filesystem::exists(folder / pair.then)) {
    GTEST_SKIP() << "the real sensor images are not here";
  }
  const auto load = [&](const char* name) {
    const image::Grey8 image = image::read_png_grey8(folder / name);
    LumaGrid grid;
    measure({image.pixels.data(), image.width, image.height, image.width}, grid);
    return grid;
  };
  ContactCheck check;
  LightField field{};
  // The published crop of 460×345 pixels about the middle, in cells of 16 pixels.
  const CellRegion crop{.x0 = 7, .y0 = 5, .x1 = 34, .y1 = 25};
  const ContactVerdict verdict =
      check.compare(load(pair.then), load(pair.now), crop, ContactCheck::kAnyShape, field);
  RecordProperty("darkening", std::to_string(verdict.darkening));
  if (pair.in_contact) {
    EXPECT_GT(verdict.darkening, 0.04F);
  } else {
    EXPECT_LT(verdict.darkening, 0.0063F);  // half of the limit of contact
    EXPECT_GT(verdict.explained, 0.9F);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Sensors, RealTouch,
    ::testing::Values(RealPair{"sensor_a", "ball_reference.png", "board_reference.png", false},
                      RealPair{"sensor_a", "board_reference.png", "ball_reference.png", false},
                      RealPair{"sensor_b", "ball_reference.png", "board_reference.png", false},
                      RealPair{"sensor_b", "board_reference.png", "ball_reference.png", false},
                      RealPair{"sensor_a", "board_reference.png", "ball.png", true},
                      RealPair{"sensor_a", "ball_reference.png", "board.png", true},
                      RealPair{"sensor_b", "board_reference.png", "ball.png", true},
                      RealPair{"sensor_b", "ball_reference.png", "board.png", true},
                      RealPair{"sensor_c", "board_reference.png", "board.png", true}));

}  // namespace
}  // namespace dtact::pipeline
