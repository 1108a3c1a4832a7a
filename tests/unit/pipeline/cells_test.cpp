#include "daemon/pipeline/reference/cells.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "daemon/recon/model.hpp"

namespace dtact::pipeline {
namespace {

constexpr int kFrameWidth = 210;  // not a multiple of a cell: the last column of cells overlaps
constexpr int kFrameHeight = 150;

std::size_t pixel(int x, int y, int width) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
         static_cast<std::size_t>(x);
}

recon::RectifyTable make_table(int frame_width = kFrameWidth, int frame_height = kFrameHeight) {
  return recon::make_crop_table(frame_width, frame_height, 1, 2, frame_width - 2, frame_height - 5);
}

std::vector<std::uint16_t> flat_reference(int grey) {
  return std::vector<std::uint16_t>(pixel(0, kFrameHeight, kFrameWidth),
                                    static_cast<std::uint16_t>(grey * 256));
}

class CellsTest : public testing::Test {
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
  std::vector<std::uint8_t> no_contact(double noise = 1) {
    return frame([](int, int) { return 0.0; }, noise);
  }
  int active_tiles(const std::vector<std::uint8_t>& luma) {
    report_ = cells_.look({luma.data(), kFrameWidth, kFrameHeight, kFrameWidth});
    readers_.mark(cells_.active(), tiles_);
    return recon::count_tiles(tiles_);
  }
  void use(const CellSettings& settings) {
    cells_ = Cells(recon::CellLattice(table_), settings);
    cells_.set_reference(reference_);
  }
  void settle(int frames = 30) {
    for (int i = 0; i < frames; ++i) (void)active_tiles(no_contact());
  }
  void SetUp() override { cells_.set_reference(reference_); }

  static constexpr int kTiles = 10 * 7;  // 208 × 145 pixels in tiles of 32 × 16
  recon::RectifyTable table_ = make_table();
  std::vector<std::uint16_t> reference_ = flat_reference(150);
  Cells cells_{recon::CellLattice(table_)};
  recon::TileReaders readers_{cells_.lattice(), table_, 6};
  recon::TileRows tiles_ = recon::TileRows(10);
  CellReport report_;

 private:
  std::mt19937 random_{3};
  std::normal_distribution<double> normal_;
};

// Ten rows of cells, from the frame's first row on.
TEST_F(CellsTest, ReportsWhichRowsAreNotNew) {
  const auto first = no_contact();
  (void)active_tiles(first);
  auto second = no_contact();
  (void)active_tiles(second);
  EXPECT_EQ(report_.frame.unchanged_rows, 0);
  (void)active_tiles(second);
  EXPECT_EQ(report_.frame.unchanged_rows, 10);
  auto torn = no_contact();
  std::copy(second.begin() + 82 * kFrameWidth, second.end(), torn.begin() + 82 * kFrameWidth);
  (void)active_tiles(torn);
  EXPECT_EQ(report_.frame.unchanged_rows, 4);  // from row 96 on; the torn one is new in part
}

TEST_F(CellsTest, WhiteRowsAreNotCalledRepeated) {
  const std::vector<std::uint8_t> white(no_contact().size(), 255);
  (void)active_tiles(white);
  (void)active_tiles(white);
  EXPECT_EQ(report_.frame.unchanged_rows, 0);
}

TEST_F(CellsTest, MeasuresNoiseWhetherQuietOrNot) {
  settle();
  EXPECT_NEAR(report_.frame.rough_noise, 1.0, 0.1);
  for (int i = 0; i < 3; ++i) (void)active_tiles(frame([](int, int) { return 20.0; }, 4));
  EXPECT_NEAR(report_.frame.rough_noise, 4.0, 0.4);
}

TEST_F(CellsTest, WanderingBandsRippleAndAPressDoesNot) {
  const auto bands = [&](double phase) {
    return frame([phase](int, int y) { return 3 * std::sin(0.07 * y + phase); });
  };
  const auto press = [&](double levels) {
    return frame([levels](int x, int y) {
      return levels * std::exp(-(std::pow(x - 100, 2) + std::pow(y - 70, 2)) / 1800);
    });
  };
  settle();
  EXPECT_LT(report_.frame.ripple, 0.2);
  (void)active_tiles(press(30));
  (void)active_tiles(press(31));  // a millimetre in half a second
  EXPECT_LT(report_.frame.ripple, 0.3);
  (void)active_tiles(bands(0));
  (void)active_tiles(bands(3));
  EXPECT_GT(report_.frame.ripple, 1.5);
}

TEST_F(CellsTest, FineBandsRippleInHalfRows) {
  // A period of 18 rows: a cell's 16 rows are nearly all of it.
  const auto bands = [&](double phase) {
    return frame([phase](int, int y) { return 3 * std::sin(0.349 * y + phase); });
  };
  settle();
  EXPECT_LT(report_.frame.fine_ripple, 0.4);
  (void)active_tiles(bands(0));
  (void)active_tiles(bands(3));
  EXPECT_LT(report_.frame.ripple, 1);
  EXPECT_GT(report_.frame.fine_ripple, 8);
}

TEST_F(CellsTest, NoiseAloneIsNoContact) {
  for (int i = 0; i < 500; ++i) ASSERT_EQ(active_tiles(no_contact()), 0) << i;
}

TEST_F(CellsTest, HealthIsGatheredInTheSameLook) {
  settle();
  auto luma = no_contact();
  for (int x = 64; x < 80; ++x) {
    luma[pixel(x, 100, kFrameWidth)] = 255;
  }
  (void)active_tiles(luma);
  EXPECT_NEAR(report_.mean_grey, 150, 0.1);
  // One level, and 4 % of other spread by whole grey levels.
  EXPECT_NEAR(report_.cell_noise, 1.04 / std::sqrt(128), 0.02);  // 128 pixels of a cell are read
  EXPECT_NEAR(report_.quiet_change, 16 * 105. / (14 * 10 * 128), 0.05);
  EXPECT_EQ(report_.frame.saturated, 16);
  EXPECT_EQ(report_.cells, 14 * 10);
  EXPECT_EQ(report_.frame.pixels, 14 * 10 * 128);
}

TEST_F(CellsTest, APressIsActiveWhereItIsAndNotElsewhere) {
  settle();
  const auto luma =
      frame([](int x, int y) { return std::hypot(x - 60, y - 70) < 20 ? 30.0 : 0.0; });
  const int active = active_tiles(luma);
  EXPECT_EQ(tiles_[70 / 16] >> (60 / 32) & 1U, 1U);
  EXPECT_EQ(tiles_[70 / 16] >> (180 / 32) & 1U, 0U);
  EXPECT_LT(active, kTiles * 6 / 10);
  EXPECT_EQ(active_tiles(no_contact()), 0) << "gone when the press is gone";
}

// CellSettings promises this: no press above these peaks stays undetected anywhere.
TEST_F(CellsTest, AFaintWidePressIsFound) {
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

TEST_F(CellsTest, ASpotOfTheGelsBlurIsFoundWhereverItLies) {
  // Scattering of 0.3 mm is a standard deviation of 8 pixels at 0.0375 mm a pixel. 0.8 levels at
  // the peak are 26 µm. There is no noise, so that only the cells' places matter.
  for (int dy = 0; dy < 16; dy += 3) {
    for (int dx = 0; dx < 16; dx += 3) {
      cells_.set_reference(reference_);
      const auto spot = [&](int x, int y) {
        const double r2 = (x - 90 - dx) * (x - 90 - dx) + (y - 70 - dy) * (y - 70 - dy);
        // Noise carries fractions of a level through the rounding to 8 bits.
        return 0.8 * std::exp(-r2 / (2 * 8.0 * 8.0)) + ((x * 7 + y * 13) % 16 - 7.5) / 16;
      };
      EXPECT_GT(active_tiles(frame(spot, 0)), 0) << dx << ", " << dy;
    }
  }
}

TEST_F(CellsTest, BelowHalfTheThresholdItLetsGo) {
  // The noise is so low that no window's mean is off by more than 0.05 levels.
  const auto level = [this](double grey) {
    return active_tiles(frame([grey](int x, int) { return x < 120 ? grey : 0.0; }, 0.3));
  };
  for (int i = 0; i < 30; ++i) (void)level(0);
  EXPECT_EQ(level(0.18), 0);
  EXPECT_GT(level(0.6), 0);
  EXPECT_GT(level(0.18), 0) << "held";
  EXPECT_EQ(level(0.0), 0);
}

TEST_F(CellsTest, SlowDriftIsFollowedAndALongPressIsNot) {
  CellSettings settings;
  settings.drift_per_frame = 0.01;
  use(settings);
  const auto press = [](int x, int y) { return std::hypot(x - 60, y - 70) < 12 ? 20.0 : 0.0; };
  for (int i = 0; i < 400; ++i) {
    const double drift = std::min(0.002 * i, 0.4);
    const auto luma = frame([&](int x, int y) { return drift + press(x, y); });
    const int active = active_tiles(luma);
    ASSERT_GT(active, 0);
    ASSERT_LT(active, kTiles * 6 / 10) << "the light's drift lights nothing, frame " << i;
  }
  EXPECT_LT(report_.drift, -0.15);
  EXPECT_EQ(active_tiles(frame([](int, int) { return 0.4; })), 0);
  EXPECT_GT(active_tiles(frame([&](int x, int y) { return 0.4 + press(x, y); })), 0)
      << "400 frames of a press absorbed nothing of it";
}

TEST_F(CellsTest, DriftEndsAtItsLimit) {
  CellSettings settings;
  settings.cell_floor = settings.cell_ceiling = 3;
  settings.window_floor = settings.window_ceiling = 2;
  settings.drift_per_frame = 0.1;
  settings.drift_limit = 0.5;
  use(settings);
  const auto darker = [this](double levels) {
    return active_tiles(frame([=](int, int) { return levels; }, 0));
  };
  for (int i = 0; i < 100; ++i) ASSERT_EQ(darker(1), 0);
  EXPECT_DOUBLE_EQ(report_.drift, -0.5);
  EXPECT_DOUBLE_EQ(report_.quiet_change, -0.5);
  EXPECT_GT(darker(3), 0);
}

TEST_F(CellsTest, ReportsAChangeOfLightFromAPress) {
  settle();
  (void)active_tiles(no_contact());
  EXPECT_EQ(report_.light.from, LightSeen::From::all);
  EXPECT_NEAR(report_.light.change, 0, 0.0002);
  const auto dimmed = [&](double share, double press) {
    return frame([=](int x, int y) {
      const double spot = std::hypot(x - 60, y - 70) < 20 ? press : 0;
      return 150 * share + spot;
    });
  };
  for (int i = 0; i < 2; ++i) {  // as it comes, and while it lasts
    (void)active_tiles(dimmed(0.02, 0));
    EXPECT_EQ(report_.light.from, LightSeen::From::all);
    EXPECT_NEAR(report_.light.change, -0.02, 0.0002);
  }
  (void)active_tiles(dimmed(0.02, 1));
  EXPECT_NE(report_.light.from, LightSeen::From::all) << "one level on a twenty-fifth of the field";
  EXPECT_EQ(report_.light.change, 0);
  (void)active_tiles(dimmed(0, 10));
  EXPECT_NE(report_.light.from, LightSeen::From::all);
}

TEST_F(CellsTest, KnowsTheLightItWasReported) {
  const auto dimmed = [this] { return frame([](int, int) { return 3.0; }); };
  EXPECT_GT(active_tiles(dimmed()), 0);
  cells_.set_light(0.98);
  for (int i = 0; i < 10; ++i) (void)active_tiles(dimmed());  // the active tiles become inactive
  EXPECT_EQ(active_tiles(dimmed()), 0);
  EXPECT_NEAR(report_.light.change, 0, 0.0002);
  EXPECT_GT(active_tiles(no_contact()), 0);
  cells_.set_reference(reference_);
  EXPECT_EQ(active_tiles(no_contact()), 0) << "a new reference is under its own light";
}

TEST_F(CellsTest, WhatWasFollowedBeforeIsPartOfTheLight) {
  CellSettings settings;
  settings.cell_floor = settings.cell_ceiling = 3;
  settings.window_floor = settings.window_ceiling = 2;
  settings.drift_per_frame = 0.1;
  use(settings);
  for (int i = 0; i < 100; ++i) (void)active_tiles(frame([](int, int) { return 0.3; }));
  EXPECT_LT(report_.drift, -0.2);
  EXPECT_NEAR(report_.light.change, -0.3 / 150, 0.0002);
}

// 60 s of a press in which the light falls by half a level, then the press is lifted: drift has
// followed the light by then, and set_light() reports the same once more.
TEST_F(CellsTest, LightThatWasFollowedAsDriftCountsOnce) {
  CellSettings settings;
  settings.drift_per_frame = 0.01;
  use(settings);
  const auto press = [](int x, int y) { return std::hypot(x - 60, y - 70) < 12 ? 20.0 : 0.0; };
  for (int i = 0; i < 400; ++i) {
    const double darker = std::min(0.002 * i, 0.5);
    (void)active_tiles(frame([&](int x, int y) { return darker + press(x, y); }));
  }
  ASSERT_LT(report_.drift, -0.4);
  const auto dimmed = [this] { return frame([](int, int) { return 0.5; }); };
  (void)active_tiles(dimmed());
  cells_.set_light(1 - 0.5 / 150);
  EXPECT_EQ(active_tiles(dimmed()), 0);
  EXPECT_EQ(report_.active_cells, 0);
  EXPECT_NEAR(report_.drift, 0, 0.05);
}

// Drift had followed a change that went back in a step: every cell is active, yet the frame is the
// reference.
TEST_F(CellsTest, DriftThatTheFrameContradictsIsForgotten) {
  CellSettings settings;
  settings.drift_per_frame = 0.01;
  use(settings);
  for (int i = 0; i < 400; ++i) {
    (void)active_tiles(frame([&](int, int) { return std::min(0.002 * i, 0.6); }));
  }
  ASSERT_LT(report_.drift, -0.5);
  EXPECT_EQ(active_tiles(no_contact()), kTiles);
  EXPECT_EQ(active_tiles(no_contact()), 0);
  EXPECT_EQ(report_.drift, 0);
}

TEST_F(CellsTest, SeesTheLightBesideAPress) {
  settle(32);
  // A ball's ring: brighter around the press by less than the threshold of an active cell.
  const auto press = [](int x, int y) {
    const double r = std::hypot(x - 60, y - 70);
    return r < 25 ? 20.0 : r < 45 ? -0.2 : 0.0;
  };
  int seen = 0;
  for (int i = 0; i < 32; ++i) {
    (void)active_tiles(frame([&](int x, int y) { return 0.15 + press(x, y); }));
    if (report_.light.from != LightSeen::From::quiet) continue;
    ++seen;
    EXPECT_NEAR(report_.light.change, -0.001, 0.0003);
  }
  EXPECT_EQ(seen, 2) << "on every sixteenth frame";
  for (int i = 0; i < 16; ++i) {
    (void)active_tiles(frame([](int x, int y) { return x < 160 ? 20.0 : 0.02 * y; }));
    EXPECT_EQ(report_.light.from, LightSeen::From::nothing) << "too little is left without contact";
  }
}

// Eight in twenty of all cells: the darkest of the light's half would be the middle of all.
TEST_F(CellsTest, APressIsNoLightHoweverWideItIs) {
  settle(32);
  int seen = 0;
  for (int i = 0; i < 32; ++i) {
    // Darker by 0.15 levels in the middle of what is left, by 0.05 at its one end.
    (void)active_tiles(
        frame([](int x, int) { return x < 96 ? 20.0 : 0.15 + (152 - x) / 56.0 * 0.1; }));
    if (report_.light.from != LightSeen::From::quiet) continue;
    ++seen;
    EXPECT_NEAR(report_.light.change, -0.001, 0.0003);
  }
  EXPECT_EQ(seen, 2);
}

TEST_F(CellsTest, ANewReferenceForgetsEverything) {
  CellSettings settings;
  settings.drift_per_frame = 0.01;
  use(settings);
  for (int i = 0; i < 100; ++i) (void)active_tiles(frame([](int, int) { return 0.1; }));
  ASSERT_LT(report_.drift, -0.08);
  (void)active_tiles(frame([](int, int) { return 50.0; }));
  EXPECT_EQ(recon::count_tiles(tiles_), kTiles);
  cells_.set_reference(flat_reference(100));
  EXPECT_EQ(active_tiles(frame([](int, int) { return 50.0; })), 0);
  EXPECT_EQ(report_.drift, 0);
}

TEST(SmallFrame, IsAlwaysActive) {
  const recon::RectifyTable table = make_table(12, 12);
  Cells cells{recon::CellLattice(table)};
  cells.set_reference(std::vector<std::uint16_t>(144, 150 * 256));
  const std::vector<std::uint8_t> luma(12 * 12 + 64, 150);
  EXPECT_EQ(cells.look({luma.data(), 12, 12, 12}).cells, 0);
  const recon::TileReaders readers(cells.lattice(), table, 6);
  recon::TileRows tiles(1);
  readers.mark(cells.active(), tiles);
  EXPECT_EQ(recon::count_tiles(tiles), 1);
}

}  // namespace
}  // namespace dtact::pipeline
