#include "daemon/recon/depth_lut.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

namespace dtact::recon {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

DepthLut good() { return {-2, {-20, -10, 0, 10, 20}, -2, 2}; }

TEST(CheckList, AcceptsAMonotoneLut) { EXPECT_NO_THROW(check(good(), true)); }

TEST(CheckList, AMeanMayFall) {
  DepthLut lut = good();
  lut.um[3] = -11;
  EXPECT_NO_THROW(check(lut, false));
}

TEST(CheckList, AcceptsLevelStretches) {
  DepthLut lut = good();
  lut.um = {0, 0, 0, 0, 0};
  EXPECT_NO_THROW(check(lut, true));
}

void expect_refused(const std::function<void(DepthLut&)>& spoil, const char* key) {
  DepthLut lut = good();
  spoil(lut);
  EXPECT_THAT([&] { check(lut, true); }, ThrowsMessage<std::invalid_argument>(HasSubstr(key)));
}

TEST(CheckList, RefusesWhatCannotBe) {
  expect_refused([](DepthLut& l) { l.um.clear(); }, "lut.um: must have");
  expect_refused([](DepthLut& l) { l.um[3] = -11; }, "entry 4");
  expect_refused([](DepthLut& l) { l.um[0] = -16384; }, "micrometres");
  expect_refused([](DepthLut& l) { l.first_q6 = 16318; }, "lut.first_q6");
  expect_refused([](DepthLut& l) { l.first_q6 = -16321; }, "lut.first_q6");
  expect_refused([](DepthLut& l) { l.covered_from_q6 = -3; }, "lut.covered_from_q6");
  expect_refused([](DepthLut& l) { l.covered_to_q6 = 3; }, "lut.covered_to_q6");
  expect_refused(
      [](DepthLut& l) {
        l.covered_from_q6 = 2;
        l.covered_to_q6 = 1;
      },
      "lut.covered_from_q6");
}

}  // namespace
}  // namespace dtact::recon
