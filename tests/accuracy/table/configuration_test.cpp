#include "tests/accuracy/table/configuration.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstddef>

namespace dtact::table {
namespace {

// Standard deviations of the paper's reference images, its table "MAE on testing images".
TEST(Configuration, ReferenceImagesAreAsUnevenAsThePapers) {
  constexpr std::array<double, 5> kPaper = {4.08, 5.24, 5.26, 5.45, 16.55};
  for (std::size_t i = 0; i < kPaper.size(); ++i) {
    SCOPED_TRACE(configurations()[i].name);
    EXPECT_NEAR(reference_deviation(configurations()[i]), kPaper[i], 0.1 * kPaper[i]);
  }
}

TEST(Configuration, SideLightIsUnevenButFarFromDark) {
  const double deviation = reference_deviation(configurations()[5]);
  EXPECT_GT(deviation, 2);
  EXPECT_LT(deviation, 25);
}

}  // namespace
}  // namespace dtact::table
