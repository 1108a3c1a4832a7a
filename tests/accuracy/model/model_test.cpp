// One press of a 4 mm ball, by the layer's model: a 5 mm ball on layers and optics that nothing was
// tuned on. Seeds other than those of README's table. The whole study: model_study.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/accuracy/model/objects.hpp"
#include "tests/accuracy/model/study.hpp"

namespace dtact::model_study {
namespace {

TEST(Model, OnePressMeasuresAnotherBallOnEveryLayer) {
  for (const std::size_t specimen : {0U, 1U, 3U}) {
    const Result result = measure(specimens()[specimen], 21, 1, 3);
    ASSERT_TRUE(result.fit) << result.refused;
    EXPECT_LE(result.model_mm, 0.025) << specimens()[specimen].name;
    EXPECT_LT(result.model_mm, result.free_mm) << specimens()[specimen].name;
    EXPECT_NEAR(result.fit->deepest_mm(), result.true_depth_mm, 0.04);
    EXPECT_NEAR(result.fit->layer.thickness_mm, specimens()[specimen].scene.layer.thickness_mm,
                0.2);
  }
}

TEST(Model, KnowsAnAbsoluteDepthUnderOtherOptics) {
  const Result result = measure(specimens()[6], 21, 1, 3);  // kinked at zero
  ASSERT_TRUE(result.fit) << result.refused;
  EXPECT_LE(result.model_mm, 0.04);
  EXPECT_LT(result.model_mm, 0.5 * result.free_mm);
}

TEST(Model, ReadsObjectsOfManyShapesSharpened) {
  const auto errors = read_objects(1);
  const ObjectErrors& list = errors.at(2);        // of one press
  const ObjectErrors& sharpened = errors.back();  // the layer's model
  EXPECT_LE(sharpened.mean_mm(), 0.040);
  EXPECT_LT(sharpened.mean_mm(), 0.5 * list.mean_mm());
  const std::vector<std::string> names = object_names();
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_LE(sharpened.object_mm(i), 0.085) << names[i];
    EXPECT_LT(sharpened.object_mm(i), list.object_mm(i)) << names[i];
  }
}

}  // namespace
}  // namespace dtact::model_study
