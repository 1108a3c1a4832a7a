// A calibration from the pictures of another project's folder.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <filesystem>
#include <regex>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/calibrate/offline/import_folder.hpp"
#include "clients/calibrate/offline/offline.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/lens/board_camera.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kConfig =
    "sensor_id: 2\n"
    "camera_setting:\n"
    "  resolution:\n"
    "    - 500 # width\n"
    "    - 400 # height\n"
    "  fps: 25\n"
    "camera_calibration:\n"
    "  row_points: 5\n"
    "  col_points: 7\n"
    "  grid_distance: 2.3\n"
    "depth_calibration:\n"
    "  BallRad: 3.5\n";

/// 24 pixels a millimetre in the middle, under a lens.
BoardCamera camera() {
  BoardCamera camera{.width = 500, .height = 400, .focal = 768, .centre = {246, 205}, .k1 = -0.1};
  camera.tilt_y = 1;
  return camera;
}
double light(cv::Point2d mm) { return 150 + 1.5 * mm.x - 0.2 * mm.dot(mm); }

/// 5 rows and 7 columns of pins, 2.3 mm apart.
double with_board(cv::Point2d mm) {
  const auto away = [](double place, int count) {
    const double index = std::round(place / 2.3 + 0.5 * (count - 1));
    return place - 2.3 * (std::clamp(index, 0.0, count - 1.0) - 0.5 * (count - 1));
  };
  const cv::Point2d off(away(mm.x, 7), away(mm.y, 5));
  return light(mm) - 16 * std::exp(-off.dot(off) / (2 * 0.45 * 0.45));
}

/// A ball of 3.5 mm pressed in 1.2 mm deep: 30 levels a millimetre, and a bulge about it.
double with_ball(cv::Point2d mm) {
  const double r = std::hypot(mm.x - 1.2, mm.y + 0.7);
  const double deep = 1.2 - (3.5 - std::sqrt(std::max(0.0, 3.5 * 3.5 - r * r)));
  return light(mm) - (deep > 0 ? 30 * deep : -6 * (1 - std::exp(8 * deep)) * std::exp(2 * deep));
}

image::Grey8 picture(double (*pattern)(cv::Point2d), std::uint64_t exposure) {
  cv::Mat1f levels = camera().photograph(pattern, 1, 0);
  cv::Mat1f grain(levels.size());
  cv::RNG(exposure).fill(grain, cv::RNG::NORMAL, 0, 0.3);
  levels += grain;
  image::Grey8 image{levels.cols, levels.rows, {}};
  for (const float level : levels) {
    image.pixels.push_back(static_cast<std::uint8_t>(std::lround(level)));
  }
  return image;
}

/// As NumPy saves a row of float64.
std::string npy(const std::vector<double>& values) {
  std::string head = "{'descr': '<f8', 'fortran_order': False, 'shape': (" +
                     std::to_string(values.size()) + ",), }";
  head.resize(117, ' ');
  std::string bytes = std::string("\x93NUMPY\x01\x00\x76\x00", 10) + head + "\n";
  for (const double value : values) {
    const auto bits = std::bit_cast<std::array<char, 8>>(value);
    bytes.append(bits.begin(), bits.end());
  }
  return bytes;
}

class Import : public testing::Test {
 protected:
  Import() {
    write("camera_calibration/ref.png", light, 1);
    write("camera_calibration/sample.png", with_board, 2);
    write("depth_calibration/ref.png", light, 3);
    write("depth_calibration/sample.png", with_ball, 4);
    text("shape_config.yaml", kConfig);
  }
  [[nodiscard]] std::string at(const std::string& name) const {
    return (temp_.path() / name).string();
  }
  void text(const std::string& name, const std::string& content) const {
    fs::create_directories(fs::path(at(name)).parent_path());
    base::write_file_atomically(at(name), content);
  }
  void write(const std::string& name, double (*pattern)(cv::Point2d), std::uint64_t seed) const {
    text(name, image::encode_png(picture(pattern, seed)));
  }
  void exchange(const std::string& folder) const {
    fs::rename(at(folder + "/ref.png"), at("kept"));
    fs::rename(at(folder + "/sample.png"), at(folder + "/ref.png"));
    fs::rename(at("kept"), at(folder + "/sample.png"));
  }
  [[nodiscard]] std::string run(const std::vector<std::string>& more = {}) const {
    CLI::App app;
    bool json = false;
    app.add_flag("--json", json);
    add_offline_commands(app, json);
    std::vector<std::string> arguments{"import", at(""), "-o", at("cal")};
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::ranges::reverse(arguments);
    testing::internal::CaptureStdout();
    try {
      app.parse(arguments);
    } catch (...) {
      (void)testing::internal::GetCapturedStdout();
      throw;
    }
    return testing::internal::GetCapturedStdout();
  }
  template <typename Matcher>
  void expect_refused(const Matcher& sentence, const std::vector<std::string>& more = {}) const {
    EXPECT_THAT([&] { (void)run(more); }, ThrowsMessage<std::runtime_error>(sentence));
    EXPECT_FALSE(fs::exists(at("cal")));
  }

 private:
  const calibration::TempFolder temp_;
};

TEST_F(Import, MakesLensAndDepthAndSaysHowGoodTheyAre) {
  std::vector<double> depth_mm;
  for (int level = 0; level < 40; ++level) depth_mm.push_back(level / 30.0);
  text("depth_calibration/Pixel_to_Depth.npy", npy(depth_mm));
  const std::string said = run();
  EXPECT_THAT(said, HasSubstr("35 of 35 pins found, 2.3 mm apart (shape_config.yaml:10)"));
  EXPECT_THAT(said, HasSubstr("ball: 3.5 mm radius (shape_config.yaml:12)"));
  std::smatch error_mm;
  ASSERT_TRUE(std::regex_search(said, error_mm, std::regex("this calibration +([0-9.]+) mm")))
      << said;
  EXPECT_LT(std::stod(error_mm[1]), 0.05);
  EXPECT_THAT(said, ContainsRegex("published LUT, Pixel_to_Depth.npy +0\\.[0-9]+ mm"));
  EXPECT_THAT(said,
              HasSubstr("[camera]\nbackend = \"v4l2\"\nwidth = 500\nheight = 400\nfps = 25\n"));
  EXPECT_THAT(said, HasSubstr("dtactctl calibration upload " + at("cal")));
  const calibration::Calibration made = calibration::load(at("cal"));
  ASSERT_TRUE(made.lens);
  EXPECT_NEAR(recon::central_mm_per_px(*made.lens), 1 / 24.0, 0.01 / 24);
  const recon::DepthLut& lut = made.model->lut;
  const auto um = [&](int level) {
    return lut.um.at(static_cast<std::size_t>(64 * level - lut.first_q6));
  };
  EXPECT_NEAR(um(30) - um(15), 500, 25);
  EXPECT_EQ(made.origin.sources.size(), 4U);
}

// The other layout of the folder, a table that is damaged, and a pitch on the command line.
TEST_F(Import, SaysWhatItUsesInPlaceOfWhat) {
  fs::rename(at("camera_calibration/ref.png"), at("board_reference.png"));
  fs::rename(at("camera_calibration/sample.png"), at("board.png"));
  fs::rename(at("depth_calibration/ref.png"), at("ball_reference.png"));
  fs::rename(at("depth_calibration/sample.png"), at("ball.png"));
  fs::remove(at("camera_calibration"));
  fs::remove(at("depth_calibration"));
  text("Pixel_to_Depth.npy", npy(std::vector<double>(40)).substr(0, 200));
  const std::string said = run({"--pitch-mm", "2.4"});
  EXPECT_THAT(said, HasSubstr("--pitch-mm: 2.4 is used, though shape_config.yaml:10 says 2.3"));
  EXPECT_THAT(said, HasSubstr("Pixel_to_Depth.npy: cannot be compared: "));
  EXPECT_NEAR(recon::central_mm_per_px(*calibration::load(at("cal")).lens), 2.4 / 2.3 / 24, 0.0005);
}

TEST_F(Import, WhatIsMissingIsNamed) {
  fs::remove(at("depth_calibration/sample.png"));
  fs::remove(at("camera_calibration/ref.png"));
  expect_refused(AllOf(HasSubstr(at("camera_calibration/ref.png")),
                       HasSubstr(at("depth_calibration/sample.png"))));
  fs::create_directories(at("all/sensor_1/camera_calibration"));
  fs::create_directories(at("all/sensor_2/depth_calibration"));
  fs::create_directories(at("all/nothing"));
  CLI::App app;
  bool json = false;
  add_offline_commands(app, json);
  EXPECT_THAT([&] { app.parse(std::vector<std::string>{at("all"), "import"}); },
              ThrowsMessage<std::runtime_error>(AllOf(
                  HasSubstr("several sensors"), HasSubstr("sensor_1"), HasSubstr("sensor_2"))));
  EXPECT_THAT([&] { app.parse(std::vector<std::string>{at("all/nothing"), "import"}); },
              ThrowsMessage<std::runtime_error>(HasSubstr("is no calibration folder")));
}

TEST_F(Import, PicturesOfOtherSizesAreNamed) {
  image::Grey8 small = picture(light, 5);
  small.height = 390;
  small.pixels.resize(500 * 390);
  text("depth_calibration/ref.png", image::encode_png(small));
  expect_refused(AllOf(HasSubstr("depth_calibration/ref.png is 500x390"), HasSubstr("500x400")));
  write("depth_calibration/ref.png", light, 3);
  text("shape_config.yaml", "resolution: [640, 480]\n");
  expect_refused(AllOf(HasSubstr("500x400"), HasSubstr("shape_config.yaml:1 says 640x480")));
}

TEST_F(Import, AWrongConfigurationIsReportedByLineAndKey) {
  text("shape_config.yaml", "a:\n  BallRad: four\n");
  expect_refused(HasSubstr("shape_config.yaml:2: BallRad: \"four\" is not allowed"));
  text("shape_config.yaml", "row_points: 6.5\n");
  expect_refused(HasSubstr("shape_config.yaml:1: row_points"));
  text("shape_config.yaml", "resolution:\n  - 640\n");
  expect_refused(HasSubstr("shape_config.yaml:1: resolution"));
  text("shape_config.yaml", "fps: 30\nfps: 60\n");
  expect_refused(HasSubstr("shape_config.yaml:2: fps stands in line 1 already"));
  EXPECT_THAT([&] { (void)run({"--config", at("none.yaml")}); },
              ThrowsMessage<std::system_error>(HasSubstr("none.yaml")));
}

TEST_F(Import, ExchangedPicturesAreRefused) {
  exchange("camera_calibration");
  expect_refused(
      AllOf(HasSubstr("camera_calibration/ref.png and sample.png"), HasSubstr("exchanged")));
  exchange("camera_calibration");
  exchange("depth_calibration");
  expect_refused(
      AllOf(HasSubstr("depth_calibration/ref.png and sample.png"), HasSubstr("exchanged")));
}

TEST_F(Import, NoBoardAndNoPressAreNamed) {
  write("camera_calibration/sample.png", light, 6);
  expect_refused(AllOf(HasSubstr("camera_calibration/ref.png and sample.png"),
                       HasSubstr("no lattice of 5x7 pins found")));
  write("camera_calibration/sample.png", with_board, 2);
  write("depth_calibration/sample.png", light, 7);
  expect_refused(
      AllOf(HasSubstr("depth_calibration/ref.png and sample.png"), HasSubstr("no contact found")));
}

TEST_F(Import, ABallThatContradictsThePictureIsRefused) {
  expect_refused(AllOf(HasSubstr("the radius is 2.2 mm (--radius-mm)"),
                       HasSubstr("2.3 mm apart (shape_config.yaml:10)")),
                 {"--radius-mm", "2.2"});
}

class ShapeConfig : public testing::Test {
 protected:
  [[nodiscard]] ImportSettings read(const std::string& text) const {
    const fs::path file = temp_.path() / "shape_config.yaml";
    base::write_file_atomically(file, text);
    ImportSettings settings;
    read_shape_config(file, settings);
    return settings;
  }
  template <typename Matcher>
  void expect_refused(const std::string& text, const Matcher& sentence) const {
    EXPECT_THAT([&] { (void)read(text); }, ThrowsMessage<std::runtime_error>(sentence)) << text;
  }

 private:
  const calibration::TempFolder temp_;
};

TEST_F(ShapeConfig, NumbersAreAllowedUpToTheirLimits) {
  EXPECT_EQ(read("row_points: 2\n").rows.value, 2);
  EXPECT_EQ(read("row_points: 100\n").rows.value, 100);
  EXPECT_EQ(read("col_points: 2\n").cols.value, 2);
  EXPECT_EQ(read("col_points: 100\n").cols.value, 100);
  EXPECT_EQ(read("grid_distance: 0.1\n").pitch_mm.value, 0.1);
  EXPECT_EQ(read("grid_distance: 100\n").pitch_mm.value, 100);
  EXPECT_EQ(read("BallRad: 0.2\n").radius_mm.value, 0.2);
  EXPECT_EQ(read("BallRad: 99\n").radius_mm.value, 99);
  EXPECT_EQ(read("fps: 0.1\n").fps.value, 0.1);
  EXPECT_EQ(read("fps: 1000\n").fps.value, 1000);
  const ImportSettings sizes = read("resolution: [16, 8192]\n");
  EXPECT_EQ(sizes.width.value_or(Stated{}).value, 16);
  EXPECT_EQ(sizes.height.value_or(Stated{}).value, 8192);
  for (const char* key : {"row_points", "col_points"}) {
    for (const char* value : {"1", "101", "-7", "7.5", "nan"}) {
      expect_refused(std::string(key) + ": " + value + "\n",
                     AllOf(HasSubstr(":1: " + std::string(key) + ": \"" + value + "\""),
                           HasSubstr("a whole number from 2 to 100")));
    }
  }
  for (const char* value : {"0.09", "100.1", "-2.5"}) {
    expect_refused("grid_distance: " + std::string(value) + "\n",
                   HasSubstr("a number from 0.1 to 100"));
  }
  for (const char* value : {"0.19", "99.1"}) {
    expect_refused("BallRad: " + std::string(value) + "\n", HasSubstr("a number from 0.2 to 99"));
  }
  for (const char* value : {"0.09", "1001"}) {
    expect_refused("fps: " + std::string(value) + "\n", HasSubstr("a number from 0.1 to 1000"));
  }
  for (const char* value : {"[15, 400]", "[500, 8193]", "[500]", "[500, 400, 3]", "[500, 40.5]"}) {
    expect_refused("resolution: " + std::string(value) + "\n",
                   HasSubstr("width and height, whole numbers from 16 to 8192"));
  }
}

TEST_F(ShapeConfig, QuotesCommentsAndOtherKeysAreNoPartOfANumber) {
  const ImportSettings settings = read(
      "# BallRad: 9\n"
      "lens: none\n"
      "camera:\r\n"
      "  resolution: [ 640 , '480' ]   # width, height\n"
      "\tBallRad:\t\"3.5\" # mm\r\n");
  EXPECT_EQ(settings.width.value_or(Stated{}).value, 640);
  EXPECT_EQ(settings.height.value_or(Stated{}).value, 480);
  EXPECT_EQ(settings.height.value_or(Stated{}).by, "shape_config.yaml:4");
  EXPECT_EQ(settings.radius_mm.value, 3.5);
  EXPECT_EQ(settings.radius_mm.by, "shape_config.yaml:5");
  EXPECT_EQ(settings.rows.by, "usual");
}

}  // namespace
}  // namespace dtact::ctl
