#include "daemon/recon/reconstructor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dtact::recon {
namespace {

using testing::Each;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int kFrameWidth = 40;
constexpr int kFrameHeight = 30;
constexpr int kMapWidth = 21;
constexpr int kMapHeight = 17;

/// Half a micrometre a Q6 unit, 32 µm a level, from −40 to +60 levels; reference 160 everywhere.
Model model_of(Method method) {
  Model model;
  model.method = method;
  model.rectify = make_crop_table(kFrameWidth, kFrameHeight, 5, 4, kMapWidth, kMapHeight);
  model.mm_per_px = 0.05;
  model.smoothing_px = 1;
  model.lut.first_q6 = -40 * 64;
  for (int q6 = -40 * 64; q6 <= 60 * 64; ++q6) {
    model.lut.um.push_back(static_cast<std::int16_t>(q6 / 2));
  }
  model.lut.covered_from_q6 = -20 * 64;
  model.lut.covered_to_q6 = 50 * 64;
  model.reference_q8.assign(static_cast<std::size_t>(kFrameWidth) * kFrameHeight, 160 * 256);
  return model;
}

struct Bench {
  explicit Bench(Model model)
      : reconstructor(std::make_shared<Model>(std::move(model))),
        luma(static_cast<std::size_t>(kFrameWidth) * kFrameHeight + 64),
        depth(static_cast<std::size_t>(kMapWidth) * kMapHeight) {}
  const std::vector<std::int16_t>& run(int grey) {
    std::ranges::fill(luma, static_cast<std::uint8_t>(grey));
    reconstructor.run(luma.data(), kFrameWidth, depth);
    return depth;
  }
  void reference(int grey) {
    reconstructor.set_reference(
        std::vector<std::uint16_t>(static_cast<std::size_t>(kFrameWidth) * kFrameHeight,
                                   static_cast<std::uint16_t>(grey * 256)));
  }
  Reconstructor reconstructor;
  std::vector<std::uint8_t> luma;
  std::vector<std::int16_t> depth;
};

TEST(ReconstructorLut, NoContactIsZeroPressedPositiveBulgeNegative) {
  Bench bench(model_of(Method::lut));
  EXPECT_THAT(bench.run(160), Each(0));
  EXPECT_THAT(bench.run(130), Each(960));
  EXPECT_THAT(bench.run(170), Each(-320));
}

TEST(ReconstructorLut, BulgeSideHoldsDeepSideIsUntrusted) {
  Bench bench(model_of(Method::lut));
  EXPECT_THAT(bench.run(255), Each(-1280));
  EXPECT_EQ(bench.reconstructor.beyond_pixels(), 0);
  EXPECT_THAT(bench.run(110), Each(1600));
  EXPECT_THAT(bench.run(109), Each(kUntrusted));
  EXPECT_EQ(bench.reconstructor.beyond_pixels(), kMapWidth * kMapHeight);
}

TEST(ReconstructorLut, HalfTheLightReadsTheSameDepth) {
  Bench bench(model_of(Method::lut));
  bench.reference(80);
  EXPECT_THAT(bench.run(80), Each(0));
  EXPECT_THAT(bench.run(65), Each(960));  // 15 levels of half the light are 30 of the whole
}

TEST(ReconstructorLut, LightThatChangedByAFactorReadsTheSameDepth) {
  Bench bench(model_of(Method::lut));
  bench.reconstructor.set_light(0.8);
  EXPECT_THAT(bench.run(128), Each(0));
  EXPECT_THAT(bench.run(104), Each(960));  // 24 levels of the dimmed light are 30
  bench.reconstructor.set_light(0.975);    // 156; replaces the other factor
  EXPECT_THAT(bench.run(156), Each(0));
  // 30 levels × 160/156 = 1969.2 Q6; half of 1969 is 984 µm.
  EXPECT_THAT(bench.run(126), Each(984));
  bench.reference(160);
  EXPECT_THAT(bench.run(160), Each(0)) << "a new reference is under its own light";
}

TEST(ReconstructorPublished, KnowsNoLight) {
  Bench bench(model_of(Method::published));
  const std::vector<std::int16_t> before = bench.run(150);
  bench.reconstructor.set_light(0.9);
  EXPECT_EQ(bench.run(150), before);
}

TEST(ReconstructorLut, TooLittleLightIsUntrusted) {
  Bench bench(model_of(Method::lut));
  bench.reference(7);
  EXPECT_THAT(bench.run(7), Each(kUntrusted));
  bench.reference(160);
  EXPECT_THAT(bench.run(160), Each(0)) << "a later reference brings the pixels back";
}

TEST(ReconstructorLut, TheMaskIsAppliedLast) {
  Model model = model_of(Method::lut);
  model.untrusted.assign(static_cast<std::size_t>(kMapWidth) * kMapHeight, 0);
  model.untrusted[3 * kMapWidth + 2] = 1;
  Bench bench(std::move(model));
  bench.run(130);
  EXPECT_EQ(bench.depth[3 * kMapWidth + 2], kUntrusted);
  EXPECT_EQ(std::ranges::count(bench.depth, 960), kMapWidth * kMapHeight - 1)
      << "no neighbour smeared";
}

TEST(ReconstructorLut, OneDarkPixelSpreadsAsTheKernel) {
  Bench bench(model_of(Method::lut));
  std::ranges::fill(bench.luma, std::uint8_t{160});
  bench.luma[(4 + 8) * kFrameWidth + 5 + 10] = 60;  // the pixel at row 8, column 10 of the map
  bench.reconstructor.run(bench.luma.data(), kFrameWidth, bench.depth);
  // 6400 · 6536/16384 = 2553.1 → 2553; · 6536/16384 = 1018.5 → 1018 Q6; half of it is 509 µm.
  EXPECT_EQ(bench.depth[8 * kMapWidth + 10], 509);
  // 6400 · 3966/16384 = 1549.2 → 1549; · 6536/16384 = 617.9 → 618; 309 µm.
  EXPECT_EQ(bench.depth[8 * kMapWidth + 11], 309);
  EXPECT_EQ(bench.depth[7 * kMapWidth + 10], 309);
  EXPECT_EQ(bench.depth[8 * kMapWidth + 14], 0) << "beyond the kernel";
}

TEST(ReconstructorLut, TheSameFrameGivesTheSameDepth) {
  Bench bench(model_of(Method::lut));
  const std::vector<std::int16_t> first = bench.run(137);
  bench.run(90);
  EXPECT_EQ(bench.run(137), first);
}

TEST(ReconstructorLut, SharpenedLevelsNeedTheirOwnLut) {
  Model model = model_of(Method::lut);
  model.scattering = Scattering{.narrow_mm = 0.1, .wide_mm = 0.4, .narrow_weight = 0.7};
  model.sharpened = {{.steps = 2, .lut = model.lut, .uncertainty = {}}};
  const auto shared = std::make_shared<const Model>(std::move(model));
  EXPECT_EQ(Reconstructor(shared, 2).sharpen_steps(), 2);
  EXPECT_EQ(Reconstructor(shared).sharpen_steps(), 0);
  EXPECT_THAT([&] { Reconstructor(shared, 1); },
              testing::ThrowsMessage<std::invalid_argument>(
                  testing::HasSubstr("no LUT for 1 step of sharpening")));
}

TEST(ReconstructorLut, TimesAreReportedWhenAskedFor) {
  Bench bench(model_of(Method::lut));
  StepTimes times{-1, -1, -1};
  bench.reconstructor.run(bench.luma.data(), kFrameWidth, bench.depth, &times);
  EXPECT_GE(times.rectify_ns, 0);
  EXPECT_GE(times.smooth_ns, 0);
  EXPECT_GE(times.lut_ns, 0);
}

TEST(ReconstructorLut, RowsMayBePaddedAndTheLastPixelIsReached) {
  Model model = model_of(Method::lut);
  model.rectify = make_crop_table(kFrameWidth, kFrameHeight, kFrameWidth - kMapWidth,
                                  kFrameHeight - kMapHeight, kMapWidth, kMapHeight);
  model.smoothing_px = 0;
  Reconstructor reconstructor(std::make_shared<Model>(std::move(model)));
  constexpr int kStride = 48;
  std::vector<std::uint8_t> luma(std::size_t{kStride} * kFrameHeight + kLumaPadding, 160);
  luma[kStride * (kFrameHeight - 1) + kFrameWidth - 1] = 150;
  std::vector<std::int16_t> depth(static_cast<std::size_t>(kMapWidth) * kMapHeight);
  reconstructor.run(luma.data(), kStride, depth);
  EXPECT_EQ(depth.back(), 320);
  EXPECT_EQ(std::ranges::count(depth, 0), kMapWidth * kMapHeight - 1);
}

TEST(ReconstructorPublished, HoldsBothEndsAndIgnoresTheLight) {
  Model model = model_of(Method::published);
  model.lut = {0, {}, 0, 40 * 64};
  for (int q6 = 0; q6 <= 40 * 64; ++q6) {
    const int level = (q6 + 32) / 64;
    model.lut.um.push_back(static_cast<std::int16_t>(std::max(0, level - 5) * 32));
  }
  Bench bench(std::move(model));
  EXPECT_THAT(bench.run(160), Each(0));
  EXPECT_THAT(bench.run(200), Each(0)) << "the unsigned difference knows no bulge";
  EXPECT_THAT(bench.run(150), Each(160));
  EXPECT_THAT(bench.run(60), Each(1120));
  EXPECT_EQ(bench.reconstructor.beyond_pixels(), kMapWidth * kMapHeight);
  bench.reference(80);
  EXPECT_THAT(bench.run(70), Each(160));
}

TEST(ReconstructorPublished, SmoothsDepthTwiceWithSevenTaps) {
  Model model = model_of(Method::published);
  Bench bench(std::move(model));
  std::ranges::fill(bench.luma, std::uint8_t{160});
  bench.luma[(4 + 8) * kFrameWidth + 5 + 10] = 110;  // 50 levels are 1600 µm
  bench.reconstructor.run(bench.luma.data(), kFrameWidth, bench.depth);
  // (1 3.5 7 9 7 3.5 1)/32 with itself has 205.5/1024 in its middle; 1600 · 0.20068² = 64.4, give
  // or take the roundings of four passes.
  EXPECT_NEAR(bench.depth[8 * kMapWidth + 10], 64, 1);
  EXPECT_EQ(bench.depth[8 * kMapWidth + 10 + 7], 0);
}

TEST(ReconstructorPublished, TheMaskDoesNotSmear) {
  Model model = model_of(Method::published);
  model.untrusted.assign(static_cast<std::size_t>(kMapWidth) * kMapHeight, 0);
  model.untrusted[0] = 1;
  Bench bench(std::move(model));
  bench.run(150);
  EXPECT_EQ(bench.depth[0], kUntrusted);
  EXPECT_EQ(std::ranges::count(bench.depth, 320), kMapWidth * kMapHeight - 1);
}

TEST(Reconstructor, MovesAndKeepsItsModel) {
  Bench bench(model_of(Method::lut));
  Reconstructor moved(std::move(bench.reconstructor));
  std::vector<std::uint8_t> luma(static_cast<std::size_t>(kFrameWidth) * kFrameHeight + 64, 130);
  moved.run(luma.data(), kFrameWidth, bench.depth);
  EXPECT_THAT(bench.depth, Each(960));
  EXPECT_EQ(moved.model().rectify.width, kMapWidth);
}

void expect_refused(const std::function<void(Model&)>& spoil, const char* what) {
  auto model = std::make_shared<Model>(model_of(Method::lut));
  spoil(*model);
  EXPECT_THAT([&] { const Reconstructor r(model); },
              ThrowsMessage<std::invalid_argument>(HasSubstr(what)));
}

TEST(Reconstructor, RefusesPartsThatDisagree) {
  EXPECT_THROW(Reconstructor(nullptr), std::invalid_argument);
  expect_refused([](Model& m) { m.reference_q8.pop_back(); }, "reference");
  expect_refused([](Model& m) { m.untrusted.resize(3); }, "untrusted");
  expect_refused([](Model& m) { m.rectify.entries.pop_back(); }, "rectify");
  expect_refused([](Model& m) { m.rectify.entries[7].x = kFrameWidth - 1; }, "rectify");
  expect_refused([](Model& m) { m.rectify.entries[7].y = -1; }, "rectify");
  expect_refused([](Model& m) { m.rectify.entries[7].fx = 129; }, "rectify");
  expect_refused([](Model& m) { m.rectify.width = 0; }, "rectify");
  expect_refused([](Model& m) { m.mm_per_px = 0; }, "mm_per_px");
  expect_refused([](Model& m) { m.smoothing_px = 50; }, "smoothing");
  expect_refused([](Model& m) { m.lut.um.clear(); }, "lut.um");
}

TEST(CropTable, CopiesTheRectangleAndReachesTheLastPixelByWeight) {
  const RectifyTable table = make_crop_table(4, 3, 2, 1, 2, 2);
  ASSERT_EQ(table.entries.size(), 4U);
  EXPECT_EQ(table.entries[0].x, 2);
  EXPECT_EQ(table.entries[0].y, 1);
  EXPECT_EQ(table.entries[0].fx, 0);
  EXPECT_EQ(table.entries[3].x, 2);
  EXPECT_EQ(table.entries[3].y, 1);
  EXPECT_EQ(table.entries[3].fx, 128);
  EXPECT_EQ(table.entries[3].fy, 128);
}

TEST(CropTable, RefusesWhatLeavesTheFrame) {
  EXPECT_THROW((void)make_crop_table(4, 3, 3, 0, 2, 2), std::invalid_argument);
  EXPECT_THROW((void)make_crop_table(4, 3, 0, 2, 2, 2), std::invalid_argument);
  EXPECT_THROW((void)make_crop_table(4, 3, -1, 0, 2, 2), std::invalid_argument);
  EXPECT_THROW((void)make_crop_table(4, 3, 0, 0, 0, 2), std::invalid_argument);
  EXPECT_THROW((void)make_crop_table(1, 3, 0, 0, 1, 1), std::invalid_argument);
  EXPECT_THROW((void)make_crop_table(40000, 3, 0, 0, 1, 1), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::recon
