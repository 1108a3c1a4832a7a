#include "daemon/recon/activity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "daemon/recon/reconstructor.hpp"
#include "tests/unit/recon/every_target.hpp"
#include "tests/unit/recon/specification.hpp"

namespace dtact::recon {
namespace {

constexpr int kFrameWidth = 210;  // not a multiple of a cell: the last column of cells overlaps
constexpr int kFrameHeight = 150;

std::size_t pixel(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

Model make_model(int frame_width = kFrameWidth, int frame_height = kFrameHeight) {
  Model model;
  model.rectify =
      make_crop_table(frame_width, frame_height, 1, 2, frame_width - 2, frame_height - 5);
  model.mm_per_px = 0.05;
  model.smoothing_px = 2;
  model.list = {-40 * 64, {}, -40 * 64, 100 * 64};
  for (int q6 = -40 * 64; q6 <= 110 * 64; ++q6) {
    model.list.um.push_back(static_cast<std::int16_t>(q6 / 2));  // 32 µm a level
  }
  model.reference_q8.assign(pixel(0, frame_height, frame_width), 150 * 256);
  return model;
}

class ActivityTest : public testing::Test {
 protected:
  /// A frame of the reference's 150 levels less `darkening(x, y)`, with noise of one level.
  template <typename Darkening>
  std::vector<std::uint8_t> frame(Darkening darkening, double noise = 1) {
    std::vector<std::uint8_t> luma;
    for (int y = 0; y < kFrameHeight; ++y) {
      for (int x = 0; x < kFrameWidth; ++x) {
        const double grey = 150 - darkening(x, y) + noise * normal_(random_);
        luma.push_back(static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L)));
      }
    }
    luma.resize(luma.size() + 64);
    return luma;
  }
  std::vector<std::uint8_t> untouched(double noise = 1) {
    return frame([](int, int) { return 0.0; }, noise);
  }
  int active_tiles(const std::vector<std::uint8_t>& luma) {
    activity_.look(luma.data(), kFrameWidth, report_);
    return report_.active_tiles;
  }
  void settle(int frames = 30) {
    for (int i = 0; i < frames; ++i) (void)active_tiles(untouched());
  }
  void SetUp() override { activity_.set_reference(model_.reference_q8); }

  Model model_ = make_model();
  Activity activity_{model_.rectify, 6};
  ActivityReport report_;

 private:
  std::mt19937 random_{3};
  std::normal_distribution<double> normal_;
};

// Ten rows of cells, from the frame's first row on.
TEST_F(ActivityTest, TellsWhichRowsAreNotNew) {
  const auto first = untouched();
  (void)active_tiles(first);
  auto second = untouched();
  (void)active_tiles(second);
  EXPECT_EQ(report_.unchanged_rows, 0);
  (void)active_tiles(second);
  EXPECT_EQ(report_.unchanged_rows, 10);
  auto torn = untouched();
  std::copy(second.begin() + 82 * kFrameWidth, second.end(), torn.begin() + 82 * kFrameWidth);
  (void)active_tiles(torn);
  EXPECT_EQ(report_.unchanged_rows, 4);  // from row 96 on; the torn one is new in part
}

TEST_F(ActivityTest, WhiteRowsAreNotCalledRepeated) {
  const std::vector<std::uint8_t> white(untouched().size(), 255);
  (void)active_tiles(white);
  (void)active_tiles(white);
  EXPECT_EQ(report_.unchanged_rows, 0);
}

TEST_F(ActivityTest, MeasuresNoiseWhetherQuietOrNot) {
  settle();
  EXPECT_NEAR(report_.rough_noise, 1.0, 0.1);
  for (int i = 0; i < 3; ++i) (void)active_tiles(frame([](int, int) { return 20.0; }, 4));
  EXPECT_NEAR(report_.rough_noise, 4.0, 0.4);
}

TEST_F(ActivityTest, WanderingBandsRippleAndAPressDoesNot) {
  const auto bands = [&](double phase) {
    return frame([phase](int, int y) { return 3 * std::sin(0.07 * y + phase); });
  };
  const auto press = [&](double levels) {
    return frame([levels](int x, int y) {
      return levels * std::exp(-(std::pow(x - 100, 2) + std::pow(y - 70, 2)) / 1800);
    });
  };
  settle();
  EXPECT_LT(report_.ripple, 0.2);
  (void)active_tiles(press(30));
  (void)active_tiles(press(31));  // a millimetre in half a second
  EXPECT_LT(report_.ripple, 0.3);
  (void)active_tiles(bands(0));
  (void)active_tiles(bands(3));
  EXPECT_GT(report_.ripple, 1.5);
}

TEST_F(ActivityTest, FineBandsRippleInHalfRows) {
  // A period of 18 rows: a cell's 16 rows are nearly all of it.
  const auto bands = [&](double phase) {
    return frame([phase](int, int y) { return 3 * std::sin(0.349 * y + phase); });
  };
  settle();
  EXPECT_LT(report_.fine_ripple, 0.4);
  (void)active_tiles(bands(0));
  (void)active_tiles(bands(3));
  EXPECT_LT(report_.ripple, 1);
  EXPECT_GT(report_.fine_ripple, 8);
}

TEST_F(ActivityTest, NoiseAloneTouchesNothing) {
  for (int i = 0; i < 500; ++i) ASSERT_EQ(active_tiles(untouched()), 0) << i;
  EXPECT_EQ(report_.tiles, 10 * 7);  // 208 × 145 pixels in tiles of 32 × 16
}

TEST_F(ActivityTest, HealthIsGatheredInTheSameLook) {
  settle();
  auto luma = untouched();
  for (int x = 64; x < 80; ++x) {
    luma[pixel(x, 100, kFrameWidth)] = 255;
    luma[pixel(x, 102, kFrameWidth)] = 2;
  }
  (void)active_tiles(luma);
  EXPECT_NEAR(report_.mean_grey, 150, 0.1);
  // One level, and 8 % of other spread by whole grey levels and chance.
  EXPECT_NEAR(report_.pixel_noise, 1.0, 0.08);
  EXPECT_NEAR(report_.cell_noise, 1.04 / std::sqrt(128), 0.02);  // 128 pixels of a cell are read
  EXPECT_NEAR(report_.quiet_change, 0, 0.05);
  EXPECT_EQ(report_.saturated, 16);
  EXPECT_EQ(report_.dark, 16);
  EXPECT_EQ(report_.cells, 14 * 10);
  EXPECT_EQ(report_.pixels, 14 * 10 * 128);
}

TEST_F(ActivityTest, APressIsActiveWhereItIsAndNotElsewhere) {
  settle();
  const auto luma =
      frame([](int x, int y) { return std::hypot(x - 60, y - 70) < 20 ? 30.0 : 0.0; });
  const TileRows& tiles = activity_.look(luma.data(), kFrameWidth, report_);
  EXPECT_EQ(tiles[70 / 16] >> (60 / 32) & 1U, 1U);
  EXPECT_EQ(tiles[70 / 16] >> (180 / 32) & 1U, 0U);
  EXPECT_LT(report_.active_tiles, report_.tiles * 6 / 10);
  EXPECT_EQ(active_tiles(untouched()), 0) << "gone when the press is gone";
}

// What ActivitySettings promises: nothing above these peaks is hidden, wherever it lies.
TEST_F(ActivityTest, AFaintWidePressIsFound) {
  for (const double sign : {-1.0, 1.0}) {
    settle();
    int found = 0;
    for (int i = 0; i < 40; ++i) {
      // 0.35 levels are 11 µm: a third of what one pixel can show.
      if (active_tiles(frame([&](int x, int) { return x < 120 ? sign * 0.35 : 0.0; })) > 0) ++found;
    }
    EXPECT_EQ(found, 40) << sign;
  }
}

TEST_F(ActivityTest, ASpotOfTheLayersBlurIsFoundWhereverItLies) {
  // Scattering of 0.3 mm is a standard deviation of 8 pixels at 0.0375 mm a pixel. 0.8 levels at
  // the peak are 26 µm. Without noise, so that it is the cells' places that are tried.
  for (int dy = 0; dy < 16; dy += 3) {
    for (int dx = 0; dx < 16; dx += 3) {
      activity_.set_reference(model_.reference_q8);
      const auto spot = [&](int x, int y) {
        const double r2 = (x - 90 - dx) * (x - 90 - dx) + (y - 70 - dy) * (y - 70 - dy);
        // Noise is what carries fractions of a level through the rounding to 8 bits.
        return 0.8 * std::exp(-r2 / (2 * 8.0 * 8.0)) + ((x * 7 + y * 13) % 16 - 7.5) / 16;
      };
      EXPECT_GT(active_tiles(frame(spot, 0)), 0) << dx << ", " << dy;
    }
  }
}

TEST_F(ActivityTest, BelowHalfTheThresholdItLetsGo) {
  settle();
  const auto level = [this](double grey) {
    return active_tiles(frame([grey](int x, int) { return x < 120 ? grey : 0.0; }));
  };
  EXPECT_EQ(level(0.15), 0);
  EXPECT_GT(level(0.6), 0);
  EXPECT_GT(level(0.22), 0) << "held";
  EXPECT_EQ(level(0.0), 0);
}

TEST_F(ActivityTest, SlowDriftIsFollowedAndALongPressIsNot) {
  ActivitySettings settings;
  settings.drift_per_frame = 0.01;
  activity_ = Activity(model_.rectify, 6, settings);
  activity_.set_reference(model_.reference_q8);
  const auto press = [](int x, int y) { return std::hypot(x - 60, y - 70) < 12 ? 20.0 : 0.0; };
  for (int i = 0; i < 400; ++i) {
    const double drift = std::min(0.002 * i, 0.4);
    const auto luma = frame([&](int x, int y) { return drift + press(x, y); });
    const int active = active_tiles(luma);
    ASSERT_GT(active, 0);
    ASSERT_LT(active, report_.tiles * 6 / 10) << "the light's drift lights nothing, frame " << i;
  }
  EXPECT_LT(report_.drift, -0.15);
  EXPECT_EQ(active_tiles(frame([](int, int) { return 0.4; })), 0);
  EXPECT_GT(active_tiles(frame([&](int x, int y) { return 0.4 + press(x, y); })), 0)
      << "400 frames of a press absorbed nothing of it";
}

TEST_F(ActivityTest, DriftEndsAtItsLimit) {
  ActivitySettings settings;
  settings.cell_floor = settings.cell_ceiling = 3;
  settings.window_floor = settings.window_ceiling = 2;
  settings.drift_per_frame = 0.1;
  settings.drift_limit = 0.5;
  activity_ = Activity(model_.rectify, 6, settings);
  activity_.set_reference(model_.reference_q8);
  const auto darker = [this](double levels) {
    return active_tiles(frame([=](int, int) { return levels; }, 0));
  };
  for (int i = 0; i < 100; ++i) ASSERT_EQ(darker(1), 0);
  EXPECT_DOUBLE_EQ(report_.drift, -0.5);
  EXPECT_DOUBLE_EQ(report_.quiet_change, -0.5);
  EXPECT_GT(darker(3), 0);
}

TEST_F(ActivityTest, TellsAChangeOfLightFromAPress) {
  settle();
  (void)active_tiles(untouched());
  EXPECT_TRUE(report_.light_alone);
  EXPECT_NEAR(report_.light_change, 0, 0.0002);
  const auto dimmed = [&](double share, double press) {
    return frame([=](int x, int y) {
      const double spot = std::hypot(x - 60, y - 70) < 20 ? press : 0;
      return 150 * share + spot;
    });
  };
  for (int i = 0; i < 2; ++i) {  // as it comes, and while it lasts
    (void)active_tiles(dimmed(0.02, 0));
    EXPECT_TRUE(report_.light_alone);
    EXPECT_NEAR(report_.light_change, -0.02, 0.0002);
  }
  (void)active_tiles(dimmed(0.02, 1));
  EXPECT_FALSE(report_.light_alone) << "one level on a twenty-fifth of the field";
  EXPECT_EQ(report_.light_change, 0);
  (void)active_tiles(dimmed(0, 10));
  EXPECT_FALSE(report_.light_alone);
}

TEST_F(ActivityTest, KnowsTheLightItWasTold) {
  const auto dimmed = [this] { return frame([](int, int) { return 3.0; }); };
  EXPECT_GT(active_tiles(dimmed()), 0);
  activity_.set_light(0.98);
  for (int i = 0; i < 10; ++i) (void)active_tiles(dimmed());  // what was active lets go
  EXPECT_EQ(active_tiles(dimmed()), 0);
  EXPECT_NEAR(report_.light_change, 0, 0.0002);
  EXPECT_GT(active_tiles(untouched()), 0);
  activity_.set_reference(model_.reference_q8);
  EXPECT_EQ(active_tiles(untouched()), 0) << "a new reference is under its own light";
}

TEST_F(ActivityTest, WhatWasFollowedBeforeIsPartOfTheLight) {
  ActivitySettings settings;
  settings.cell_floor = settings.cell_ceiling = 3;
  settings.window_floor = settings.window_ceiling = 2;
  settings.drift_per_frame = 0.1;
  activity_ = Activity(model_.rectify, 6, settings);
  activity_.set_reference(model_.reference_q8);
  for (int i = 0; i < 100; ++i) (void)active_tiles(frame([](int, int) { return 0.3; }));
  EXPECT_LT(report_.drift, -0.2);
  EXPECT_NEAR(report_.light_change, -0.3 / 150, 0.0002);
}

TEST_F(ActivityTest, ANewReferenceForgetsEverything) {
  (void)active_tiles(frame([](int, int) { return 50.0; }));
  EXPECT_EQ(report_.active_tiles, report_.tiles);
  activity_.set_reference(
      std::vector<std::uint16_t>(pixel(0, kFrameHeight, kFrameWidth), 100 * 256));
  EXPECT_EQ(active_tiles(frame([](int, int) { return 50.0; })), 0);
}

TEST(ActivitySmall, AFrameSmallerThanACellIsAlwaysActive) {
  const Model model = make_model(12, 12);
  Activity activity(model.rectify, 6);
  activity.set_reference(model.reference_q8);
  const std::vector<std::uint8_t> luma(12 * 12 + 64, 150);
  ActivityReport report;
  activity.look(luma.data(), 12, report);
  EXPECT_EQ(report.active_tiles, report.tiles);
}

/// The whole of run_active against the specification, on every instruction set.
class ActiveTiles : public EveryTarget {};

TEST_P(ActiveTiles, HoldTheFullResultAndTheRestIsCleared) {
  Model made = make_model();
  made.untrusted.assign(made.rectify.entries.size(), 0);
  made.untrusted[5] = 1;
  made.untrusted[made.untrusted.size() / 2] = 1;
  const auto model = std::make_shared<const Model>(std::move(made));
  Reconstructor reconstructor(model);
  Specification specification(*model);
  const TileGrid& grid = reconstructor.grid();
  // Two buffers, as a frame pool has, in unequal turns.
  std::vector<std::int16_t> depth[2];
  DrawnTiles drawn[2];
  for (auto& buffer : depth) buffer.assign(model->rectify.entries.size(), 12345);

  std::mt19937 random(9);
  int partly = 0;
  for (int i = 0; i < 60; ++i) {
    const int x0 = static_cast<int>(random() % kFrameWidth);
    const int y0 = static_cast<int>(random() % kFrameHeight);
    const int radius = static_cast<int>(random() % 50) - 10;
    std::vector<std::uint8_t> luma(pixel(0, kFrameHeight, kFrameWidth) + 64, 150);
    for (int y = 0; y < kFrameHeight; ++y) {
      for (int x = 0; x < kFrameWidth; ++x) {
        if (std::hypot(x - x0, y - y0) < radius) {
          luma[pixel(x, y, kFrameWidth)] = static_cast<std::uint8_t>(20 + random() % 200);
        }
      }
    }
    if (i == 40) {
      std::vector<std::uint16_t> darker(model->reference_q8);
      darker[3000] = 0;
      reconstructor.set_reference(darker);
      specification.set_reference(darker);
    }
    const std::size_t b = random() % 3 == 0 ? 1 : 0;
    ActivityReport report;
    reconstructor.run_active(luma.data(), kFrameWidth, depth[b], drawn[b], report);
    if (report.active_tiles > 0 && report.active_tiles < report.tiles) ++partly;

    const std::vector<std::int16_t> full = specification.run(luma.data(), kFrameWidth);
    for (int y = 0; y < grid.height; ++y) {
      for (int x = 0; x < grid.width; ++x) {
        const auto at = pixel(x, y, grid.width);
        const std::uint64_t row = drawn[b].tiles[static_cast<std::size_t>(y / TileGrid::kRows)];
        const bool active = (row >> (x / grid.tile_width()) & 1U) != 0;
        const bool marked = full[at] == kUntrusted && model->untrusted[at] != 0;
        const bool dark = i >= 40 && full[at] == kUntrusted;
        const int rest = marked || (dark && depth[b][at] == kUntrusted) ? kUntrusted : 0;
        ASSERT_EQ(depth[b][at], active ? full[at] : rest) << x << ", " << y << " in frame " << i;
      }
    }
  }
  EXPECT_GT(partly, 20);
}

TEST_P(ActiveTiles, AFlatFrameIsAllRest) {
  const auto model = std::make_shared<const Model>(make_model());
  Reconstructor reconstructor(model);
  std::vector<std::int16_t> depth(model->rectify.entries.size(), 777);
  DrawnTiles drawn;
  ActivityReport report;
  const std::vector<std::uint8_t> luma(pixel(0, kFrameHeight, kFrameWidth) + 64, 150);
  reconstructor.run_active(luma.data(), kFrameWidth, depth, drawn, report);
  EXPECT_EQ(report.active_tiles, 0);
  EXPECT_EQ(std::ranges::count(depth, 0), static_cast<std::ptrdiff_t>(depth.size()));
}

DTACT_EVERY_TARGET(ActiveTiles);

}  // namespace
}  // namespace dtact::recon
