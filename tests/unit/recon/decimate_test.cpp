#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <stdexcept>
#include <vector>

#include "daemon/recon/kernels.hpp"
#include "daemon/recon/model.hpp"
#include "daemon/recon/reconstructor.hpp"

namespace dtact::recon {
namespace {

/// 16×12 pixels of the frame from column 2, row 3; 32 µm a level; no smoothing.
Model straight_model() {
  Model model;
  model.rectify = make_crop_table(24, 20, 2, 3, 16, 12);
  model.mm_per_px = 0.05;
  model.lut = {-100 * 64, {}, -100 * 64, 100 * 64};
  for (int q6 = -100 * 64; q6 <= 100 * 64; ++q6) {
    model.lut.um.push_back(static_cast<std::int16_t>(q6 / 2));
  }
  model.reference_q8.assign(std::size_t{24} * 20, 150 * 256);
  return model;
}

std::vector<std::int16_t> run(const Model& model, int (*grey)(int, int)) {
  std::vector<std::uint8_t> luma;
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 24; ++x) luma.push_back(static_cast<std::uint8_t>(grey(x, y)));
  }
  luma.resize(luma.size() + 64);
  Reconstructor reconstructor(std::make_shared<const Model>(model));
  std::vector<std::int16_t> depth(
      static_cast<std::size_t>(model.rectify.width * model.rectify.height));
  reconstructor.run(luma.data(), 24, depth);
  return depth;
}

/// The depth that the model for frames of 1/scale the size makes of the means of run()'s pixels.
std::vector<std::int16_t> run_scaled(const Model& model, int scale, int (*grey)(int, int)) {
  const Model scaled = for_scaled_frames(model, scale);
  std::vector<std::uint8_t> luma;
  for (int y = 0; y < 20; y += scale) {
    for (int x = 0; x < 24; x += scale) {
      int sum = scale * scale / 2;
      for (int i = 0; i < scale * scale; ++i) sum += grey(x + i % scale, y + i / scale);
      luma.push_back(static_cast<std::uint8_t>(sum / (scale * scale)));
    }
  }
  luma.resize(luma.size() + 64);
  Reconstructor reconstructor(std::make_shared<const Model>(scaled));
  std::vector<std::int16_t> depth(
      static_cast<std::size_t>(scaled.rectify.width * scaled.rectify.height));
  reconstructor.run(luma.data(), 24 / scale, depth);
  return depth;
}

// The map begins at column 2 and row 3, so that rows are read between two of the scaled frame.
TEST(ScaledFrames, GiveTheDecimatedMapOfAPlaneAnywhere) {
  const auto plane = [](int x, int y) { return 150 - x - 3 * y; };
  for (const int scale : {2, 4}) {
    const auto expected = run(decimate(straight_model(), scale), plane);
    const auto depth = run_scaled(straight_model(), scale, plane);
    ASSERT_EQ(depth.size(), expected.size());
    for (std::size_t i = 0; i < depth.size(); ++i) {
      EXPECT_NEAR(depth[i], expected[i], 20) << scale << ", pixel " << i;  // 0.6 grey levels
    }
  }
}

TEST(ScaledFrames, KeepMillimetresSmoothingAndMarks) {
  Model model = straight_model();
  model.smoothing_px = 2;
  model.untrusted.assign(std::size_t{16} * 12, 0);
  model.untrusted[16 * 5 + 3] = 1;
  const Model half = for_scaled_frames(model, 2);
  EXPECT_EQ(half.rectify.frame_width, 12);
  EXPECT_EQ(half.rectify.frame_height, 10);
  EXPECT_EQ(half.rectify.width, 8);
  EXPECT_EQ(half.rectify.height, 6);
  EXPECT_EQ(half.rectify.entries.size(), 8U * 6U);
  EXPECT_EQ(half.frame_scale, 2);
  EXPECT_DOUBLE_EQ(half.mm_per_px, 0.1);
  EXPECT_DOUBLE_EQ(half.smoothing_px, 1);
  EXPECT_EQ(half.untrusted[8 * 2 + 1], 1);
  EXPECT_EQ(half.reference_q8, std::vector<std::uint16_t>(std::size_t{12} * 10, 150 * 256));
  EXPECT_NO_THROW(check(half));
  EXPECT_EQ(decimate(half, 2).rectify.width, 4);
}

// Each pixel of the reference differs: 10 more a column, 100 more a row.
TEST(ScaledFrames, AverageTheReferenceRoundedHalfUp) {
  Model model = straight_model();
  for (std::size_t i = 0; i < model.reference_q8.size(); ++i) {
    model.reference_q8[i] = static_cast<std::uint16_t>(1000 + 10 * (i % 24) + 100 * (i / 24));
  }
  model.reference_q8[24 * 7 + 11] += 2;  // half a unit of its mean of four
  model.reference_q8[24 * 7 + 13] += 1;  // a quarter
  const Model half = for_scaled_frames(model, 2);
  ASSERT_EQ(half.reference_q8.size(), std::size_t{12} * 10);
  EXPECT_EQ(half.reference_q8[0], 1055);           // 1000 + 10/2 + 100/2
  EXPECT_EQ(half.reference_q8[11], 1275);          // 220 more, 11 columns on
  EXPECT_EQ(half.reference_q8[12 * 9], 2855);      // 1800 more, 9 rows down
  EXPECT_EQ(half.reference_q8[12 * 3 + 5], 1756);  // 1055 + 5 · 20 + 3 · 200 + 1/2
  EXPECT_EQ(half.reference_q8[12 * 3 + 6], 1775);  // 1055 + 6 · 20 + 3 · 200 + 1/4
  const Model quarter = for_scaled_frames(model, 4);
  ASSERT_EQ(quarter.reference_q8.size(), std::size_t{6} * 5);
  EXPECT_EQ(quarter.reference_q8[6 * 4 + 5], 2965);  // 1000 + 10 · 21.5 + 100 · 17.5
}

// The middle of a scaled pixel is the middle of the pixels that it is the mean of.
TEST(ScaledFrames, AreReadAtTheMiddleOfEachArea) {
  const RectifyTable half = for_scaled_frames(straight_model(), 2).rectify;
  const auto expect_place = [](const RectifyTable::Entry& at, int x, int fx, int y, int fy) {
    EXPECT_EQ(at.x, x);
    EXPECT_EQ(at.fx, fx);
    EXPECT_EQ(at.y, y);
    EXPECT_EQ(at.fy, fy);
  };
  // Columns 2 and 3, rows 3 and 4: the scaled frame's column 1 and row 1.5.
  expect_place(half.entries.front(), 1, 0, 1, 64);
  // Columns 16 and 17, rows 13 and 14.
  expect_place(half.entries.back(), 8, 0, 6, 64);
  expect_place(half.entries[8 * 2 + 3], 4, 0, 3, 64);
  // The frame's last column is reached from the one before with the full weight, the last row, too.
  Model corner = straight_model();
  corner.rectify = make_crop_table(24, 20, 8, 8, 16, 12);
  expect_place(for_scaled_frames(corner, 2).rectify.entries.back(), 10, 128, 8, 128);
}

TEST(ScaledFrames, HaveTwoPixelsAtLeast) {
  Model model = straight_model();
  const auto resize = [&model](int width, int height) {
    model.rectify = make_crop_table(width, height, 0, 0, 4, 4);
    model.reference_q8.assign(static_cast<std::size_t>(width * height), 150 * 256);
  };
  resize(8, 12);
  EXPECT_EQ(for_scaled_frames(model, 4).rectify.frame_width, 2);
  resize(12, 8);
  EXPECT_EQ(for_scaled_frames(model, 4).rectify.frame_height, 2);
  resize(4, 12);
  EXPECT_THROW((void)for_scaled_frames(model, 4), std::invalid_argument);
  resize(12, 4);
  EXPECT_THROW((void)for_scaled_frames(model, 4), std::invalid_argument);
}

TEST(ScaledFrames, AreMultiplesOfTheScale) {
  Model model = straight_model();
  EXPECT_THROW((void)for_scaled_frames(model, 3), std::invalid_argument);
  model.rectify = make_crop_table(23, 20, 2, 3, 16, 12);
  model.reference_q8.assign(std::size_t{23} * 20, 150 * 256);
  EXPECT_THROW((void)for_scaled_frames(model, 2), std::invalid_argument);
}

TEST(Decimate, KeepsMillimetresAndDropsWhatFillsNoPixel) {
  Model model = straight_model();
  model.rectify = make_crop_table(24, 20, 2, 3, 15, 11);
  model.smoothing_px = 2;
  const Model half = decimate(model, 2);
  EXPECT_EQ(half.rectify.width, 7);
  EXPECT_EQ(half.rectify.height, 5);
  EXPECT_EQ(half.rectify.entries.size(), 14U * 10U);
  EXPECT_DOUBLE_EQ(half.mm_per_px, 0.1);
  EXPECT_DOUBLE_EQ(half.smoothing_px, 1);
  EXPECT_EQ(decimate(model, 1).rectify.entries.size(), 15U * 11U);
}

TEST(Decimate, WhatFillsNoPixelIsDroppedOnBothSides) {
  Model model = straight_model();
  model.rectify = make_crop_table(24, 20, 2, 3, 15, 11);
  // Of 15 columns 12 stay and of 11 rows 8: one is dropped before them and two after.
  const RectifyTable quarter = decimate(model, 4).rectify;
  EXPECT_EQ(quarter.entries.front().x, 3);
  EXPECT_EQ(quarter.entries.front().y, 4);
  EXPECT_EQ(quarter.entries.back().x, 14);
  EXPECT_EQ(quarter.entries.back().y, 11);
}

TEST(Decimate, APixelIsTheMeanOfItsArea) {
  // One dark pixel of 120 levels below the reference, alone in its area.
  const auto dark = [](int x, int y) { return x == 2 + 5 && y == 3 + 6 ? 70 : 150; };
  const std::vector<std::int16_t> half = run(decimate(straight_model(), 2), dark);
  EXPECT_EQ(half[3 * 8 + 2], 640);  // 80 levels / 4 · 32 µm
  EXPECT_EQ(half[3 * 8 + 3], 0);
  const std::vector<std::int16_t> quarter = run(decimate(straight_model(), 4), dark);
  EXPECT_EQ(quarter[1 * 4 + 1], 160);  // 80 levels / 16 · 32 µm
}

TEST(Decimate, NothingAliases) {
  // The finest possible stripes, in either direction: a coarse map that picked pixels would show
  // all of them or none.
  for (const int factor : {2, 4}) {
    for (const std::int16_t um : run(decimate(straight_model(), factor),
                                     [](int x, int) { return x % 2 == 0 ? 110 : 150; })) {
      EXPECT_EQ(um, 640);  // 20 levels
    }
    for (const std::int16_t um : run(decimate(straight_model(), factor),
                                     [](int, int y) { return y % 2 == 0 ? 110 : 150; })) {
      EXPECT_EQ(um, 640);
    }
  }
}

TEST(Decimate, AnUntrustedPixelMarksItsArea) {
  for (const unsigned pixel : {4U * 16 + 6, 4U * 16 + 7, 5U * 16 + 6, 5U * 16 + 7}) {
    Model model = straight_model();
    model.untrusted.assign(std::size_t{16} * 12, 0);
    model.untrusted[pixel] = 1;
    const std::vector<std::int16_t> half = run(decimate(model, 2), [](int, int) { return 150; });
    for (std::size_t i = 0; i < half.size(); ++i) {
      EXPECT_EQ(half[i], i == 2 * 8 + 3 ? kUntrusted : 0) << pixel << " " << i;
    }
  }
}

TEST(Decimate, AMarkOfWhatFillsNoPixelIsDropped) {
  Model model = straight_model();
  model.rectify = make_crop_table(24, 20, 2, 3, 15, 11);
  // Columns 1 to 12 and rows 1 to 8 make three pixels by two.
  const auto marked = [&model](std::size_t x, std::size_t y) {
    model.untrusted.assign(std::size_t{15} * 11, 0);
    model.untrusted[15 * y + x] = 1;
    return decimate(model, 4).untrusted;
  };
  EXPECT_EQ(marked(0, 1), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(marked(1, 0), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(marked(1, 1), (std::vector<std::uint8_t>{1, 0, 0, 0, 0, 0}));
  EXPECT_EQ(marked(5, 4), (std::vector<std::uint8_t>{0, 1, 0, 0, 0, 0}));
  EXPECT_EQ(marked(12, 8), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(marked(13, 8), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(marked(12, 9), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 0}));
}

TEST(Decimate, OnePixelIsEnough) {
  Model model = straight_model();
  model.rectify = make_crop_table(24, 20, 2, 3, 4, 7);
  EXPECT_EQ(decimate(model, 4).rectify.width, 1);
  model.rectify = make_crop_table(24, 20, 2, 3, 7, 4);
  EXPECT_EQ(decimate(model, 4).rectify.height, 1);
  model.rectify = make_crop_table(24, 20, 2, 3, 3, 7);
  EXPECT_THROW((void)decimate(model, 4), std::invalid_argument);
}

TEST(Decimate, RefusesWhatItCannotDo) {
  const Model model = straight_model();
  EXPECT_THROW((void)decimate(model, 3), std::invalid_argument);
  EXPECT_THROW((void)decimate(decimate(model, 2), 2), std::invalid_argument);
  Model thin = model;
  thin.rectify = make_crop_table(24, 20, 0, 0, 16, 3);
  EXPECT_THROW((void)decimate(thin, 4), std::invalid_argument);
}

TEST(AverageReferenceRow, RoundsTheMeanHalfUp) {
  const std::array<std::int16_t, 4> upper{1, 1, 16320, 16320};
  const std::array<std::int16_t, 4> lower{0, 0, 16320, 16319};
  const std::array<const std::int16_t*, 2> rows{upper.data(), lower.data()};
  std::array<std::int16_t, 2> out{};
  kernels::average_reference_row(rows.data(), 2, 2, out.data());
  EXPECT_EQ(out[0], 1);      // 0.5
  EXPECT_EQ(out[1], 16320);  // 16319.75
  kernels::average_reference_row(rows.data(), 1, 2, out.data());
  EXPECT_EQ(out, (std::array<std::int16_t, 2>{1, 1}));
}

TEST(RectifyMeanRow, AddsReadingsUpBeforeItRounds) {
  // Four pixels of 10 levels; an eighth of one is 14 levels: 4/32 of a level, 8 units of Q6, in the
  // sum of four.
  const std::vector<std::uint8_t> luma{10, 10, 10, 10, 14, 10, 10, 10, 10, 10, 10, 10};
  std::vector<RectifyTable::Entry> entries(4);
  for (RectifyTable::Entry& e : entries) e = {0, 0, 0, 0};
  entries[3] = {0, 0, 0, 4};  // 4/128 of the row below: 1/8 of a level
  const std::array<std::int16_t, 1> reference{1000};
  std::array<std::int16_t, 1> out{};
  kernels::rectify_mean_difference_row(luma.data(), 4, entries.data(), 2, 2, reference.data(), 1,
                                       out.data());
  EXPECT_EQ(out[0], 1000 - 642);                            // 640 + 8/4
  for (RectifyTable::Entry& e : entries) e = {0, 0, 0, 1};  // 4/128 of a level each: 2 units
  entries[0] = {0, 0, 0, 0};
  kernels::rectify_mean_difference_row(luma.data(), 4, entries.data(), 2, 2, reference.data(), 1,
                                       out.data());
  EXPECT_EQ(out[0], 1000 - 642);  // 640 + 1.5, up
}

}  // namespace
}  // namespace dtact::recon
