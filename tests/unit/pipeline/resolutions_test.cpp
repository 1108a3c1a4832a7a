#include "daemon/pipeline/depth/resolutions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <vector>

#include "daemon/pipeline/untouched/calibrated_image.hpp"
#include "tests/fakes/scattering_toy.hpp"

namespace dtact::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using Calibration = std::shared_ptr<const calibration::Calibration>;

struct Rung {
  int made = 0;  ///< 1/made of the resolution, …
  int steps = 0;
  int map = 0;  ///< … interpolated to 1/map.
  bool operator==(const Rung&) const = default;
};

constexpr int kAuto = ReconstructionRules::kAutoSharpen;

/// `method`: ReconstructionRules::decimation.
std::vector<Rung> rungs(const Calibration& calibration, int method, int sharpen) {
  const CalibratedImage image(calibration);
  Resolutions maps(calibration->model, image.cells.lattice(),
                   {.decimation = method, .sharpen = sharpen});
  std::vector<Rung> all;
  for (std::size_t i = 0; i < maps.rungs().size(); ++i) {
    maps.use(i);
    all.push_back({maps.in_use().decimation(), maps.in_use().steps(), maps.shape().decimation});
  }
  return all;
}

/// The toy whose light is scattered farther than the filter reaches.
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
  EXPECT_THAT(rungs(toy, 1, 0), ElementsAre(Rung{1, 0, 1}));
  EXPECT_THAT(rungs(toy, 2, 0), ElementsAre(Rung{2, 0, 2}));
  EXPECT_THAT(rungs(toy, 4, 0), ElementsAre(Rung{4, 0, 4}));
  EXPECT_THAT(rungs(toy, 0, 0), ElementsAre(Rung{4, 0, 4}, Rung{2, 0, 2}, Rung{1, 0, 1}));
}

TEST(Resolutions, SharpenAtAQuarterForTheMapOfTheMethod) {
  const Calibration toy = fakes::scattering_toy_calibration(15);
  for (const int steps : {1, 2}) {
    EXPECT_THAT(rungs(toy, 1, steps), ElementsAre(Rung{4, steps, 1}));
    EXPECT_THAT(rungs(toy, 2, steps), ElementsAre(Rung{4, steps, 2}));
    EXPECT_THAT(rungs(toy, 4, steps), ElementsAre(Rung{4, steps, 4}));
    EXPECT_THAT(rungs(toy, 0, steps), ElementsAre(Rung{4, steps, 4}));
  }
}

// A ladder goes from the cheapest to the dearest, and a map sharpened at a quarter and interpolated
// costs about half of a plain one at full resolution.
TEST(Resolutions, ThatChooseTheirStepsAreAllMadeAtAQuarter) {
  const Calibration toy = fakes::scattering_toy_calibration(15);
  for (const int map : {1, 2, 4}) {
    EXPECT_THAT(rungs(toy, map, kAuto),
                ElementsAre(Rung{4, 0, map}, Rung{4, 1, map}, Rung{4, 2, map}));
  }
  EXPECT_THAT(rungs(toy, 0, kAuto), ElementsAre(Rung{4, 0, 4}, Rung{4, 1, 4}, Rung{4, 2, 4}));
}

TEST(Resolutions, ThatChooseTheirStepsArePlainWhereThereAreNone) {
  for (const Calibration& toy : {Calibration(fakes::toy_calibration()), too_wide()}) {
    for (const int method : {0, 1, 2, 4}) {
      EXPECT_EQ(rungs(toy, method, kAuto), rungs(toy, method, 0)) << method;
    }
  }
}

TEST(Resolutions, RefuseStepsThatTheFilterCannotTake) {
  EXPECT_THAT([] { (void)rungs(too_wide(), 1, 2); },
              testing::ThrowsMessage<std::invalid_argument>(
                  testing::AllOf(HasSubstr("scattering.wide_mm: 19"), HasSubstr("\"auto\""))));
}

}  // namespace
}  // namespace dtact::pipeline
