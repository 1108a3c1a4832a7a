#include "daemon/recon/list.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

namespace dtact::recon {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

DepthList good() { return {-2, {-20, -10, 0, 10, 20}, -2, 2}; }

TEST(CheckList, AcceptsAMonotoneList) { EXPECT_NO_THROW(check(good(), true)); }

TEST(CheckList, AMeanMayFall) {
  DepthList list = good();
  list.um[3] = -11;
  EXPECT_NO_THROW(check(list, false));
}

TEST(CheckList, AcceptsLevelStretches) {
  DepthList list = good();
  list.um = {0, 0, 0, 0, 0};
  EXPECT_NO_THROW(check(list, true));
}

void expect_refused(const std::function<void(DepthList&)>& spoil, const char* key) {
  DepthList list = good();
  spoil(list);
  EXPECT_THAT([&] { check(list, true); }, ThrowsMessage<std::invalid_argument>(HasSubstr(key)));
}

TEST(CheckList, RefusesWhatCannotBe) {
  expect_refused([](DepthList& l) { l.um.clear(); }, "list.um: must have");
  expect_refused([](DepthList& l) { l.um[3] = -11; }, "entry 4");
  expect_refused([](DepthList& l) { l.um[0] = -16384; }, "micrometres");
  expect_refused([](DepthList& l) { l.first_q6 = 16318; }, "list.first_q6");
  expect_refused([](DepthList& l) { l.first_q6 = -16321; }, "list.first_q6");
  expect_refused([](DepthList& l) { l.covered_from_q6 = -3; }, "list.covered_from_q6");
  expect_refused([](DepthList& l) { l.covered_to_q6 = 3; }, "list.covered_to_q6");
  expect_refused(
      [](DepthList& l) {
        l.covered_from_q6 = 2;
        l.covered_to_q6 = 1;
      },
      "list.covered_from_q6");
}

}  // namespace
}  // namespace dtact::recon
