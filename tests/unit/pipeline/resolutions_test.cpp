#include "daemon/pipeline/depth/resolutions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "daemon/pipeline/reference/calibrated_image.hpp"
#include "tests/fakes/scattering_toy.hpp"

namespace dtact::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Calibration = std::shared_ptr<const calibration::Calibration>;

struct MapVariant {
  int made = 0;  ///< Computed at 1/made of the full resolution, …
  int steps = 0;
  int map = 0;  ///< … interpolated to 1/map.
  bool operator==(const MapVariant&) const = default;
};

constexpr int kAuto = ReconstructionRules::kAutoSharpen;

/// `method`: ReconstructionRules::decimation.
std::vector<MapVariant> resolutions(const Calibration& calibration, int method, int sharpen) {
  const CalibratedImage image(calibration);
  Resolutions maps(calibration->model, image.cells.lattice(),
                   {.decimation = method, .sharpen = sharpen});
  std::vector<MapVariant> all;
  for (std::size_t i = 0; i < maps.resolutions().size(); ++i) {
    maps.use(i);
    all.push_back({maps.in_use().decimation(), maps.in_use().steps(), maps.shape().decimation});
  }
  return all;
}

/// The toy with light that scatters farther than the filter reaches.
Calibration too_wide() {
  auto made = fakes::scattering_toy_calibration(15);
  recon::Model model = *made->model;
  model.scattering->wide_mm = 19;
  model.mm_per_px = 0.05;
  made->model = std::make_shared<const recon::Model>(std::move(model));
  return made;
}

TEST(Resolutions, ArePlainWithoutSharpening) {
  const Calibration toy = fakes::scattering_toy_calibration(15);
  EXPECT_THAT(resolutions(toy, 1, 0), ElementsAre(MapVariant{1, 0, 1}));
  EXPECT_THAT(resolutions(toy, 2, 0), ElementsAre(MapVariant{2, 0, 2}));
  EXPECT_THAT(resolutions(toy, 4, 0), ElementsAre(MapVariant{4, 0, 4}));
  EXPECT_THAT(resolutions(toy, 0, 0),
              ElementsAre(MapVariant{4, 0, 4}, MapVariant{2, 0, 2}, MapVariant{1, 0, 1}));
}

/// As decoded at 1/scale of the size.
Calibration scaled(const Calibration& calibration, int scale) {
  auto made = std::make_shared<calibration::Calibration>(*calibration);
  made->model =
      std::make_shared<const recon::Model>(recon::for_scaled_frames(*calibration->model, scale));
  return made;
}

TEST(Resolutions, AreNoFinerThanTheFrames) {
  const Calibration half = scaled(fakes::scattering_toy_calibration(15), 2);
  EXPECT_THAT(resolutions(half, 1, 0), ElementsAre(MapVariant{2, 0, 2}));
  EXPECT_THAT(resolutions(half, 2, 0), ElementsAre(MapVariant{2, 0, 2}));
  EXPECT_THAT(resolutions(half, 4, 0), ElementsAre(MapVariant{4, 0, 4}));
  EXPECT_THAT(resolutions(half, 0, 0), ElementsAre(MapVariant{4, 0, 4}, MapVariant{2, 0, 2}));
  EXPECT_THAT(resolutions(half, 1, 1), ElementsAre(MapVariant{4, 1, 2}));
  const Calibration quarter = scaled(fakes::scattering_toy_calibration(15), 4);
  EXPECT_THAT(resolutions(quarter, 0, 0), ElementsAre(MapVariant{4, 0, 4}));
  EXPECT_THAT(resolutions(quarter, 1, kAuto),
              ElementsAre(MapVariant{4, 0, 4}, MapVariant{4, 1, 4}, MapVariant{4, 2, 4}));
}

TEST(Resolutions, OfScaledFramesHaveTheSameMillimetres) {
  const Calibration whole = fakes::scattering_toy_calibration(15);
  for (const int map : {2, 4}) {
    const auto shape = [map](const Calibration& of) {
      return Resolutions(of->model, CalibratedImage(of).cells.lattice(), {.decimation = map})
          .shape();
    };
    const MapShape expected = shape(whole);
    const MapShape got = shape(scaled(whole, 2));
    EXPECT_EQ(got.width, expected.width);
    EXPECT_EQ(got.height, expected.height);
    EXPECT_EQ(got.decimation, expected.decimation);
    EXPECT_DOUBLE_EQ(got.mm_per_px, expected.mm_per_px);
  }
}

TEST(Resolutions, SharpenAtAQuarterForTheMapOfTheMethod) {
  const Calibration toy = fakes::scattering_toy_calibration(15);
  for (const int steps : {1, 2}) {
    EXPECT_THAT(resolutions(toy, 1, steps), ElementsAre(MapVariant{4, steps, 1}));
    EXPECT_THAT(resolutions(toy, 2, steps), ElementsAre(MapVariant{4, steps, 2}));
    EXPECT_THAT(resolutions(toy, 4, steps), ElementsAre(MapVariant{4, steps, 4}));
    EXPECT_THAT(resolutions(toy, 0, steps), ElementsAre(MapVariant{4, steps, 4}));
  }
}

// A ladder goes from the cheapest to the dearest, and a map sharpened at a quarter and interpolated
// costs about half of a plain one at full resolution.
TEST(Resolutions, ThatChooseTheirStepsAreAllMadeAtAQuarter) {
  const Calibration toy = fakes::scattering_toy_calibration(15);
  for (const int map : {1, 2, 4}) {
    EXPECT_THAT(resolutions(toy, map, kAuto),
                ElementsAre(MapVariant{4, 0, map}, MapVariant{4, 1, map}, MapVariant{4, 2, map}));
  }
  EXPECT_THAT(resolutions(toy, 0, kAuto),
              ElementsAre(MapVariant{4, 0, 4}, MapVariant{4, 1, 4}, MapVariant{4, 2, 4}));
}

TEST(Resolutions, ThatChooseTheirStepsArePlainWhereThereAreNone) {
  for (const Calibration& toy : {Calibration(fakes::toy_calibration()), too_wide()}) {
    for (const int method : {0, 1, 2, 4}) {
      EXPECT_EQ(resolutions(toy, method, kAuto), resolutions(toy, method, 0)) << method;
    }
  }
}

// The light is 100 in the map, a grey level of which is 32 um (the toy), and 2 around it.
TEST(Resolutions, CountTheLightOfTheMapAlone) {
  const auto toy = fakes::toy_calibration();
  recon::Model model = *toy->model;
  model.reference_q8.assign(model.reference_q8.size(), 2 * 256);
  for (const recon::RectifyTable::Entry& at : model.rectify.entries) {
    model.reference_q8[static_cast<std::size_t>(at.y) * fakes::kToyWidth +
                       static_cast<std::size_t>(at.x)] = 100 * 256;
  }
  // A dark corner of the map is left out as well.
  for (std::size_t i = 0; i < 20; ++i) {
    const recon::RectifyTable::Entry& at = model.rectify.entries[i];
    model.reference_q8[static_cast<std::size_t>(at.y) * fakes::kToyWidth +
                       static_cast<std::size_t>(at.x)] = 2 * 256;
  }
  model.uncertainty = {{.depth_mm = 0.5, .error_um = 0}};
  const CalibratedImage image(fakes::toy_calibration());
  const Resolutions maps(std::make_shared<const recon::Model>(std::move(model)),
                         image.cells.lattice(), {.decimation = 1});
  EXPECT_NEAR(maps.contact_um(1, 0, {.light_left = 0.01}), 0.01 * 100 * 32, 0.01);
}

TEST(Resolutions, HaveTheUncertaintyOfTheirOwnLut) {
  const auto toy = fakes::scattering_toy_calibration(15);
  recon::Model model = *toy->model;
  model.uncertainty = {{.depth_mm = 0.5, .error_um = 31}};
  model.sharpened[1].uncertainty = {{.depth_mm = 0.5, .error_um = 9}};
  const CalibratedImage image(toy);
  const Resolutions maps(std::make_shared<const recon::Model>(std::move(model)),
                         image.cells.lattice(), {.decimation = 1});
  EXPECT_EQ(maps.lut_um(0.5, 0), 31);
  EXPECT_EQ(maps.lut_um(0.5, 1), 15);
  EXPECT_EQ(maps.lut_um(0.5, 2), 9);
}

TEST(Resolutions, RefuseStepsThatTheFilterCannotTake) {
  EXPECT_THAT([] { (void)resolutions(too_wide(), 1, 2); },
              testing::ThrowsMessage<std::invalid_argument>(
                  testing::AllOf(HasSubstr("scattering.wide_mm: 19"), HasSubstr("\"auto\""))));
}

}  // namespace
}  // namespace dtact::pipeline
