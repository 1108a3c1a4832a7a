// dtact-calibrate import on the folders of real sensors.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/offline/offline.hpp"
#include "daemon/calibration/calibration.hpp"
#include "tests/accuracy/real/press_images.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::ctl {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

std::string import(const std::string& folder, const std::string& output,
                   const std::vector<std::string>& options = {}) {
  CLI::App app;
  bool json = false;
  add_offline_commands(app, json);
  testing::internal::CaptureStdout();
  try {
    std::vector<std::string> words{output, "-o", folder, "import"};  // the last one comes first
    words.insert(words.begin(), options.rbegin(), options.rend());
    app.parse(words);
  } catch (...) {
    (void)testing::internal::GetCapturedStdout();
    throw;
  }
  std::string said = testing::internal::GetCapturedStdout();
  fmt::print("{}", said);
  return said;
}

/// The number that follows `words`.
double after(const std::string& said, const std::string& words) {
  std::smatch found;
  if (!std::regex_search(said, found, std::regex(words + "\\s+([0-9.]+)"))) {
    throw std::runtime_error("not said: " + words);
  }
  return std::stod(found[1]);
}

TEST(RealImport, SensorA) {
  const auto folder = sensor_folder("sensor_a");
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const calibration::TempFolder temp;
  const std::string said = import(folder->string(), temp.path() / "cal");
  EXPECT_THAT(said, HasSubstr("63 of 63 pins found"));
  EXPECT_LE(after(said, "this calibration"), 0.012);
  EXPECT_LE(after(said, "on the rest:"), 0.0115);  // see the test below
  EXPECT_GT(after(said, "published LUT, made from the same press"), 0.008);
  EXPECT_NEAR(calibration::load(temp.path() / "cal").model->mm_per_px, 0.05102, 0.002);
}

// In true places the contact's inner part agrees better between its sectors, its rim worse: the
// LUT's straight line to the origin reads the rim too deep, which perspective hid (README.md, "The
// rim").
TEST(RealImport, SensorAWithoutPerspective) {
  const auto folder = sensor_folder("sensor_a");
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const calibration::TempFolder temp;
  const std::string said = import(folder->string(), temp.path() / "cal", {"--camera-mm", "1000"});
  EXPECT_LE(after(said, "on the rest:"), 0.0095);
}

TEST(RealImport, SensorBIsAHardPress) {
  const auto folder = sensor_folder("sensor_b");
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const calibration::TempFolder temp;
  const std::string said = import(folder->string(), temp.path() / "cal");
  EXPECT_THAT(said, HasSubstr("63 of 63 pins found"));
  EXPECT_LE(after(said, "on the rest:"), 0.045);
}

TEST(RealImport, SensorCHasNoBall) {
  const auto folder = sensor_folder("sensor_c");
  if (!folder) GTEST_SKIP() << "the real images are not beside the repository";
  const calibration::TempFolder temp;
  EXPECT_THAT([&] { (void)import(folder->string(), temp.path() / "cal"); },
              ThrowsMessage<std::runtime_error>(testing::AllOf(HasSubstr("ball_reference.png"),
                                                               HasSubstr("ball.png"),
                                                               HasSubstr("dtact-calibrate lens"))));
}

}  // namespace
}  // namespace dtact::ctl
