// A folder's evaluation on real images changed as in other sensors of the family. The ball's and
// the pins' readings must not depend on the camera's rotation or on where the light is weak.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "tests/accuracy/real/folder_evaluation.hpp"
#include "tests/accuracy/real/press_images.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::ctl {
namespace {

using Change = PressImages (*)(const PressImages&);

PressImages as_it_is(const PressImages& images) { return images; }

void save(const cv::Mat1f& levels, const std::filesystem::path& path) {
  image::Grey8 image{levels.cols, levels.rows, {}};
  for (const float level : levels) image.pixels.push_back(static_cast<std::uint8_t>(level));
  base::write_file_atomically(path, image::encode_png(image));
}

/// The folder's evaluation with all four images changed.
FolderEvaluation changed(const std::filesystem::path& folder, Change change, const char* what) {
  const calibration::TempFolder temp;
  for (const char* object : {"board", "ball"}) {
    const PressImages pair = change(load_pair(folder, object));
    save(pair.reference, temp.path() / fmt::format("{}_reference.png", object));
    save(pair.frame, temp.path() / fmt::format("{}.png", object));
  }
  FolderEvaluation e = evaluate_folder(temp.path(), {}, 4.0);
  for (const std::string& line : lines_of(e)) {
    fmt::print("{} {}: {}\n", folder.filename().string(), what, line);
  }
  return e;
}

struct Row {
  const char* what;
  Change change;
  double times;  ///< Limit, relative to the unaltered images' half-disc error.
};

/// Each change on one sensor of the two; RobustPins has them on all.
struct Case {
  const char* sensor;
  std::vector<Row> rows;
};

class RobustFolder : public testing::TestWithParam<Case> {};

TEST_P(RobustFolder, ReadsTheBallAsBefore) {
  const auto folder = sensor_folder(GetParam().sensor);
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const FolderEvaluation plain = changed(*folder, as_it_is, "as it is");
  ASSERT_TRUE(plain.ball && plain.ball->half_mae_mm);
  for (const auto& [what, change, times] : GetParam().rows) {
    const FolderEvaluation e = changed(*folder, change, what);
    ASSERT_TRUE(e.ball && e.ball->half_mae_mm) << what << ": " << e.no_ball;
    EXPECT_LE(*e.ball->half_mae_mm, times * *plain.ball->half_mae_mm) << what;
    ASSERT_TRUE(e.pin_depths) << what;
    EXPECT_LE(e.pin_depths->spread, 0.07) << what;
    // A tilt of the whole surface is a deeper press on one side.
    if (change != tilted) {
      EXPECT_NEAR(e.ball->contact.radius_mm, plain.ball->contact.radius_mm, 0.25) << what;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Sensors, RobustFolder,
    testing::Values(Case{"sensor_a", {{"portrait", turned, 1.05}, {"leaking", leaking, 1.3}}},
                    Case{"sensor_b",
                         {{"dark corners", dark_corners, 1.5}, {"tilted", tilted, 1.5}}}),
    [](const auto& one) { return std::string(one.param.sensor); });

}  // namespace
}  // namespace dtact::ctl
