// One press of a 4 mm ball, fitted with the gel's model; judged on a 5 mm ball, on gels and optics
// that nothing was tuned on. Seeds other than those of README's table. The whole study:
// model_study.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <string>

#include "tests/accuracy/model/objects.hpp"
#include "tests/accuracy/model/study.hpp"

namespace dtact::model_study {
namespace {

/// From one press, measured once for all tests.
const Result& measured(std::size_t specimen) {
  static std::map<std::size_t, Result> results;
  const auto found = results.find(specimen);
  if (found != results.end()) return found->second;
  return results.emplace(specimen, measure(specimens()[specimen], 21, 1, 3)).first->second;
}

TEST(Model, OnePressMeasuresAnotherBallOnEveryGel) {
  for (const std::size_t specimen : {0U, 1U, 3U}) {
    const Result& result = measured(specimen);
    ASSERT_TRUE(result.fit) << result.refused;
    EXPECT_LE(result.model_mm, 0.025) << specimens()[specimen].name;
    EXPECT_LT(result.model_mm, result.free_mm) << specimens()[specimen].name;
    EXPECT_NEAR(result.fit->deepest_mm(), result.true_depth_mm, 0.04);
    EXPECT_NEAR(result.fit->gel.thickness_mm, specimens()[specimen].scene.gel.thickness_mm, 0.2);
  }
}

TEST(Model, KnowsAnAbsoluteDepthUnderOtherOptics) {
  const Result& result = measured(6);  // kinked at zero
  ASSERT_TRUE(result.fit) << result.refused;
  EXPECT_LE(result.model_mm, 0.04);
  EXPECT_LT(result.model_mm, 0.5 * result.free_mm);
}

TEST(Ours, IsTheGelsLutWhereTheGelExplainsThePress) {
  const Result& result = measured(1);
  EXPECT_NE(result.note.find("which explains all but noise"), std::string::npos) << result.note;
  EXPECT_EQ(result.ours_mm, result.model_mm);
}

// The sphere alone reads a tenth of a millimetre wrong there, and the shape of the gel's LUT is
// not the sensor's.
TEST(Ours, TakesTheDepthsOfAGelThatIsNotQuiteRight) {
  const Result& one = measured(specimens().size() - 1);
  EXPECT_NE(one.note.find("at the depth of a gel"), std::string::npos) << one.note;
  EXPECT_LE(one.ours_mm, 0.020);
  EXPECT_LT(one.ours_mm, 0.25 * one.free_mm);
  const Result six = measure(specimens().back(), 21, 6, 3);
  EXPECT_NE(six.note.find("at the depths of a gel"), std::string::npos) << six.note;
  EXPECT_LE(six.ours_mm, 0.020);
}

TEST(Model, ReadsObjectsOfManyShapesSharpened) {
  const auto errors =
      read_objects(1, table::Law::built_in, {.calibration_presses = 0, .test_presses = 0});
  const ObjectErrors& lut = errors.at(2);         // of one press
  const ObjectErrors& sharpened = errors.back();  // the gel's model
  EXPECT_LE(sharpened.mean_mm(), 0.040);
  EXPECT_LT(sharpened.mean_mm(), 0.5 * lut.mean_mm());
  const std::vector<std::string> names = object_names();
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_LE(sharpened.object_mm(i), 0.085) << names[i];
    EXPECT_LT(sharpened.object_mm(i), lut.object_mm(i)) << names[i];
  }
}

}  // namespace
}  // namespace dtact::model_study
