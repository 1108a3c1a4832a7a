#include "daemon/recon/model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>

namespace dtact::recon {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// A map of 4×4 in a frame of 8×8, with everything that sharpening needs.
Model good() {
  Model model;
  model.rectify = make_crop_table(8, 8, 2, 2, 4, 4);
  model.mm_per_px = 0.1;
  model.lut = {.first_q6 = 0, .um = {0, 1}, .covered_from_q6 = 0, .covered_to_q6 = 1};
  model.reference_q8.assign(64, 160 * 256);
  model.scattering = Scattering{.narrow_mm = 0.3, .wide_mm = 1.2, .narrow_weight = 0.6};
  model.sharpened = {{.steps = 1, .lut = model.lut, .uncertainty = {}},
                     {.steps = 2, .lut = model.lut, .uncertainty = {}}};
  return model;
}

void expect_refused(const std::function<void(Model&)>& spoil, const std::string& what) {
  Model model = good();
  spoil(model);
  EXPECT_THAT([&] { check(model); }, ThrowsMessage<std::invalid_argument>(HasSubstr(what)));
}

TEST(CheckModel, AcceptsScatteringWithAndWithoutLuts) {
  Model model = good();
  EXPECT_NO_THROW(check(model));
  model.sharpened.clear();
  EXPECT_NO_THROW(check(model));
  model.scattering.reset();
  EXPECT_NO_THROW(check(model));
}

TEST(CheckModel, RefusesImpossibleScattering) {
  expect_refused([](Model& m) { m.scattering->narrow_mm = 0; }, "narrow_mm");
  expect_refused([](Model& m) { m.scattering->narrow_mm = NAN; }, "narrow_mm");
  expect_refused([](Model& m) { m.scattering->wide_mm = 0.3; }, "wide_mm");
  expect_refused([](Model& m) { m.scattering->wide_mm = 21; }, "wide_mm");
  expect_refused([](Model& m) { m.scattering->narrow_weight = -0.1; }, "narrow_weight");
}

TEST(CheckModel, RefusesSharpenedLutsThatFitNothing) {
  expect_refused([](Model& m) { m.scattering.reset(); }, "need the scattering");
  expect_refused([](Model& m) { m.method = Method::published; }, "published");
  expect_refused([](Model& m) { m.sharpened[1].steps = 3; }, "1 or 2");
  expect_refused([](Model& m) { m.sharpened[1].steps = 1; }, "rise");
  expect_refused([](Model& m) { m.sharpened[0].lut.um = {1, 0}; }, "must not fall");
}

}  // namespace
}  // namespace dtact::recon
