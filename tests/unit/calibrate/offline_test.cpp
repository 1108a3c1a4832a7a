#include "clients/calibrate/offline/offline.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "clients/calibrate/offline/depth_build.hpp"
#include "clients/calibrate/offline/drawing.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/calibration/ball.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using calibration::Ball;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

class Offline : public testing::Test {
 protected:
  Offline() {
    write("reference.png", Ball{}.reference_image());
    write("ball.png", Ball{}.frame());
  }
  [[nodiscard]] std::string at(const std::string& name) const {
    return (temp_.path() / name).string();
  }
  void write(const std::string& name, const image::Grey8& image) const {
    base::write_file_atomically(at(name), image::encode_png(image));
  }
  /// Runs one command and returns what it printed.
  static std::string run(std::vector<std::string> arguments) {
    CLI::App app;
    app.require_subcommand(1);
    app.fallthrough();
    bool json = false;
    app.add_flag("--json", json);
    add_offline_commands(app, json);
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
  [[nodiscard]] std::vector<std::string> calibrate() const {
    return {"depth",       "--reference",  at("reference.png"),
            "--ball",      at("ball.png"), "--radius-mm",
            "4.0",         "--mm-per-px",  "0.05",
            "--camera-mm", "1000",         "-o",
            at("cal")};
  }
  [[nodiscard]] std::vector<std::string> apply(const std::string& output) const {
    return {"apply",   "--calibration", at("cal"), "--reference", at("reference.png"),
            "--frame", at("ball.png"),  "-o",      at(output)};
  }
  template <typename... More>
  static std::vector<std::string> with(std::vector<std::string> arguments, More... more) {
    (arguments.emplace_back(more), ...);
    return arguments;
  }

 private:
  const calibration::TempFolder temp_;
};

TEST_F(Offline, CalibratesAndSaysWhatItFound) {
  const std::string said = run(calibrate());
  EXPECT_THAT(said, AllOf(HasSubstr("method auto"), HasSubstr("260x240 at column 0, row 0")));
  const calibration::Calibration made = calibration::load(at("cal"));
  EXPECT_EQ(made.model->mm_per_px, 0.05);
  EXPECT_EQ(made.origin.scale_from, "--mm-per-px");
  EXPECT_EQ(made.model->reference_q8[0], 200 * 256);
  ASSERT_EQ(made.origin.sources.size(), 2U);
  EXPECT_EQ(made.origin.sources[1].name, "ball.png");
  EXPECT_EQ(made.origin.created.size(), 20U);
}

TEST_F(Offline, TakesTheScaleFromARuler) {
  std::vector<std::string> arguments = calibrate();
  const auto scale = std::ranges::find(arguments, "--mm-per-px");
  *scale = "--ruler";
  scale[1] = "20,30,140,190,10";  // 120 columns and 160 rows: 200 pixels
  (void)run(arguments);
  const calibration::Calibration made = calibration::load(at("cal"));
  EXPECT_EQ(made.model->mm_per_px, 0.05);
  EXPECT_EQ(made.origin.scale_from, "a ruler, 10 mm from 20, 30 to 140, 190");
  const std::pair<const char*, const char*> wrong[] = {
      {"20,30,260,190,10", "outside of the picture of 260x240"},
      {"20,30,79,109,5", "are 99 pixels apart"},
      {"20,30,140,190,1000", "5.00000 mm per pixel"},
      {"20,30,140,190,nan", "nan"}};
  for (const auto& [ruler, words] : wrong) {
    scale[1] = ruler;
    EXPECT_THAT([&] { run(arguments); }, ThrowsMessage<std::runtime_error>(HasSubstr(words)));
  }
  arguments.erase(scale, scale + 2);
  EXPECT_THAT([&] { run(arguments); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("--lens"), HasSubstr("--ruler"), HasSubstr("--mm-per-px"))));
  EXPECT_THROW(run(with(calibrate(), "--ruler", "20,30,140,190,10")), CLI::ParseError);
}

TEST_F(Offline, RefusesSizesThatAreNone) {
  for (const char* size : {"nan", "inf", "1e-300", "-4"}) {
    for (const char* given : {"4.0", "0.05"}) {
      std::vector<std::string> arguments = calibrate();
      *(std::ranges::find(arguments, given)) = size;
      EXPECT_THROW(run(arguments), CLI::ValidationError) << given << " as " << size;
    }
  }
  EXPECT_FALSE(fs::exists(at("cal")));
}

TEST_F(Offline, RefusesADoubtfulCalibrationUnlessForced) {
  std::vector<std::string> arguments = calibrate();
  *(std::ranges::find(arguments, "0.05")) = "0.005";
  EXPECT_THAT([&] { run(arguments); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("a grey level is 0.3 um"), HasSubstr("--mm-per-px"),
                        HasSubstr("--radius-mm"), HasSubstr("--force"))));
  EXPECT_FALSE(fs::exists(at("cal")));
  EXPECT_THAT(run(with(arguments, "--force")),
              AllOf(HasSubstr("doubtful: a grey level is 0.3 um"), HasSubstr("method auto")));
  EXPECT_EQ(calibration::load(at("cal")).model->mm_per_px, 0.005);
  // Both one press and several, with our files and with others'.
  EXPECT_THAT([&] { run(with(arguments, "--method", "published")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("a grey level is")));
  write("light.png", Ball{.depth_mm = 0.5}.frame());
  const std::vector<std::string> several{"depth",         "--reference",  at("reference.png"),
                                         "--press",       at("ball.png"), "--press",
                                         at("light.png"), "--radius-mm",  "4.0",
                                         "--mm-per-px",   "0.005",        "-o",
                                         at("cal2")};
  EXPECT_THAT([&] { run(several); },
              ThrowsMessage<std::runtime_error>(HasSubstr("a grey level is")));
  EXPECT_FALSE(fs::exists(at("cal2")));
}

TEST_F(Offline, CropIsAboutTheCentre) {
  run(with(calibrate(), "--centre", "125,115", "--crop", "180,200"));
  const calibration::Calibration made = calibration::load(at("cal"));
  EXPECT_EQ(made.crop_col, 35);
  EXPECT_EQ(made.crop_row, 15);
  EXPECT_EQ(made.model->rectify.width, 180);
  EXPECT_EQ(made.model->rectify.height, 200);
  run(with(calibrate(), "--crop", "180,200"));
  EXPECT_EQ(calibration::load(at("cal")).crop_col, 40);
  EXPECT_THAT([&] { run(with(calibrate(), "--centre", "1,2")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("--crop")));
}

TEST_F(Offline, RefusesACropBeyondThePicture) {
  for (const auto& [crop, centre] :
       {std::pair{"900,600", "130,120"}, {"100,100", "20,120"}, {"100,100", "130,219"}}) {
    EXPECT_THAT([&] { (void)run(with(calibrate(), "--crop", crop, "--centre", centre)); },
                ThrowsMessage<std::runtime_error>(HasSubstr("leaves the picture of 260x240")));
  }
  EXPECT_FALSE(fs::exists(at("cal")));
}

TEST_F(Offline, AnAtInAFoldersNameIsNoDepth) {
  fs::create_directories(at("cal@left/press@01"));
  write("cal@left/press@01/00.png", Ball{}.frame());
  const std::string folder = "cal@left/press@01";
  for (const std::string& press : {folder, folder + "@" + std::to_string(Ball{}.depth_mm)}) {
    (void)run({"depth", "--reference", at("reference.png"), "--press", at(press), "--radius-mm",
               "4.0", "--mm-per-px", "0.05", "--camera-mm", "1000", "-o", at("cal")});
    EXPECT_EQ(calibration::load(at("cal")).origin.sources.size(), 2U) << press;
  }
}

// Its 16 bits hold grey × 256, those of other images grey × 257.
TEST_F(Offline, ReadsTheReferenceOfACalibration) {
  (void)run(calibrate());
  EXPECT_EQ(load_images({at("cal/reference.png")}, "--reference").mean_q8().pixels,
            calibration::load(at("cal")).model->reference_q8);
}

TEST_F(Offline, AFolderStandsForItsImages) {
  fs::create_directory(at("frames"));
  image::Grey8 image = Ball{}.reference_image();
  write("frames/1.png", image);
  for (std::uint8_t& v : image.pixels) v = 201;
  write("frames/2.png", image);
  base::write_file_atomically(at("frames/notes.txt"), "not an image");
  std::vector<std::string> arguments = calibrate();
  arguments[2] = at("frames");
  run(arguments);
  const calibration::Calibration made = calibration::load(at("cal"));
  EXPECT_EQ(made.model->reference_q8[0], 200 * 256 + 128) << "the mean keeps its fraction";
  EXPECT_EQ(made.origin.sources.size(), 3U);
}

TEST_F(Offline, AFolderSaysUnderWhichCameraAndLight) {
  fs::create_directory(at("frames"));
  write("frames/1.png", Ball{}.reference_image());
  base::write_file_atomically(at("frames/sensor.toml"),
                              "version = 1\n[camera]\nidentity = \"usb-1\"\npixel_format = "
                              "\"GREY\"\nfps = 60.0\n[camera.controls]\ngain = 5\n[light]\nleds = "
                              "[9, 8, 7]\n");
  std::vector<std::string> arguments = calibrate();
  run(arguments);
  EXPECT_EQ(calibration::load(at("cal")).origin.camera, "") << "images alone say nothing";
  arguments[2] = at("frames");
  run(arguments);
  const calibration::Origin origin = calibration::load(at("cal")).origin;
  EXPECT_EQ(origin.camera, "usb-1");
  EXPECT_EQ(origin.controls.at(0).value, 5);
  EXPECT_EQ(origin.leds, (std::vector<std::uint8_t>{9, 8, 7}));
  EXPECT_EQ(origin.sources.size(), 2U);
}

TEST_F(Offline, EvaluatesInSentencesAndJson) {
  EXPECT_THAT(run(calibrate()), HasSubstr("press: sectors that were left out are"));
  const std::vector<std::string> evaluate{"evaluate",     "--calibration",     at("cal"),
                                          "--reference",  at("reference.png"), "--ball",
                                          at("ball.png"), "--radius-mm",       "4.0"};
  EXPECT_THAT(run(evaluate), AllOf(HasSubstr("mean absolute error"), HasSubstr("untrusted: 0 of")));
  const std::string json = run(with(evaluate, "--json"));
  EXPECT_THAT(json, AllOf(HasSubstr("{\"centre_row\":110."), HasSubstr("\"mae_mm\":0.00"),
                          HasSubstr("\"half_mae_mm\":0.0"), HasSubstr("\"sector_mae_mm\":0.0"),
                          HasSubstr("\"untrusted_pixels\":0")));
  run(with(calibrate(), "--method", "published"));
  EXPECT_THAT(run(with(evaluate, "--json")), Not(HasSubstr("half_mae_mm")));
}

TEST_F(Offline, ReconstructsToNpy) {
  run(calibrate());
  EXPECT_THAT(run(apply("depth.npy")), HasSubstr("260x240, deepest 1."));
  const std::string npy = base::read_file(at("depth.npy"));
  EXPECT_EQ(npy.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  EXPECT_THAT(npy, HasSubstr("'shape': (240, 260)"));
  EXPECT_EQ(npy.size(), 128U + 240U * 260U * 4U);
}

TEST_F(Offline, ReconstructsToPictureAndPoints) {
  run(calibrate());
  run(apply("depth.png"));
  const image::Grey8 picture = image::read_png_grey8(at("depth.png"));
  EXPECT_GT(picture.width, 260);
  EXPECT_GT(picture.height, 240);
  run(apply("depth.ply"));
  EXPECT_THAT(base::read_file(at("depth.ply")), HasSubstr("element vertex 62400\n"));
}

TEST_F(Offline, NamesWhatIsWrong) {
  EXPECT_THAT([&] { run(apply("depth.npy")); },
              ThrowsMessage<std::runtime_error>(HasSubstr("no such folder")));
  run(calibrate());
  EXPECT_THAT([&] { run(apply("depth.tif")); },
              ThrowsMessage<std::runtime_error>(HasSubstr(".npy, .png, .ply or .pcd")));
  std::vector<std::string> missing = calibrate();
  missing[2] = at("none.png");
  EXPECT_THAT([&] { run(missing); }, ThrowsMessage<std::runtime_error>(HasSubstr("none.png")));
  write("wide.png", Ball{.width = 300}.frame());
  std::vector<std::string> sizes = calibrate();
  sizes[4] = at("wide.png");
  EXPECT_THAT([&] { run(sizes); },
              ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("300x240"), HasSubstr("--ball"))));
  fs::create_directory(at("empty"));
  std::vector<std::string> empty = calibrate();
  empty[2] = at("empty");
  EXPECT_THAT([&] { run(empty); }, ThrowsMessage<std::runtime_error>(HasSubstr("no .png file")));
  write("wide_reference.png", Ball{.width = 300}.reference_image());
  std::vector<std::string> other = apply("depth.npy");
  other[4] = at("wide_reference.png");
  other[6] = at("wide.png");
  EXPECT_THAT([&] { run(other); },
              ThrowsMessage<std::runtime_error>(HasSubstr("calibration is for 260x240")));
  EXPECT_THROW(run(with(calibrate(), "--method", "magic")), CLI::ParseError);
  std::vector<std::string> inside_out = calibrate();
  *std::ranges::find(inside_out, "4.0") = "-4";
  EXPECT_THAT([&] { run(inside_out); }, ThrowsMessage<CLI::ParseError>(HasSubstr("--radius-mm")));
}

// Presses are distinguished by their names, and one that counts twice chains with itself.
TEST_F(Offline, RefusesAPressThatIsGivenTwice) {
  MapOptions map;
  map.mm_per_px = 0.05;
  PressImages images = begin_presses({at("reference.png")}, 4, map);
  add_press(images, at("ball.png") + "@1.5");
  EXPECT_THAT([&] { add_press(images, at("") + "./ball.png"); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("--press"), HasSubstr("ball.png@1.5 again"))));
  write("light.png", Ball{.depth_mm = 0.5}.frame());
  add_press(images, at("light.png"));
  EXPECT_EQ(images.set.presses.size(), 2U);
}

TEST_F(Offline, RefusesMeasuredDepthsThatAMethodDoesNotUse) {
  write("light.png", Ball{.depth_mm = 0.5}.frame());
  for (const std::string method : {"model", "regression"}) {
    EXPECT_THAT(
        [&] {
          run({"depth", "--reference", at("reference.png"), "--press", at("ball.png") + "@1.5",
               "--press", at("light.png"), "--radius-mm", "4.0", "--mm-per-px", "0.05", "--method",
               method, "-o", at("cal")});
        },
        ThrowsMessage<std::runtime_error>(
            HasSubstr("--method " + method + " does not use measured depths")));
  }
  EXPECT_FALSE(fs::exists(at("cal")));
}

TEST(DepthFile, NpyIsLittleEndianFloats) {
  const std::vector<float> mm{0.0F, 1.5F, -0.25F, std::numeric_limits<float>::quiet_NaN()};
  const std::string npy = cli::encode_npy({2, 2, 0.05, mm});
  ASSERT_EQ(npy.size(), 128U + 16U);
  EXPECT_EQ(npy[127], '\n');
  EXPECT_EQ(npy.substr(128, 12), std::string("\0\0\0\0\0\0\xC0\x3F\0\0\x80\xBE", 12));
}

TEST(DepthFile, PointsLeaveUntrustedOutAndPressDown) {
  const float hole = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> mm{hole, 0.5F, 0.5F, hole, 0.5F, 0.5F};
  const std::string ply = cli::encoder_for("a.ply", nullptr)({3, 2, 0.1, mm});
  EXPECT_THAT(ply, AllOf(HasSubstr("binary_little_endian"), HasSubstr("element vertex 4\n"),
                         HasSubstr("element face 2\n")));
  const std::string point = ply.substr(ply.find("end_header\n") + 11 + 24, 12);
  EXPECT_EQ(point, std::string("\x17\xB7\xD1\x38\x17\xB7\x51\xB8\x6F\x12\x03\xBA", 12))
      << "1e-4, -5e-5, -5e-4";
  EXPECT_THAT(cli::encoder_for("a.pcd", nullptr)({3, 2, 0.1, mm}), HasSubstr("WIDTH 3\n"));
}

TEST(DepthFile, APictureOfNothingStillHasItsLegend) {
  const std::vector<float> mm(4, std::numeric_limits<float>::quiet_NaN());
  EXPECT_GT(encode_legend_png({2, 2, 0.1, mm}).size(), 100U);
}

// CropIsAboutTheCentre's crop in a larger frame: 6 of the daemon's 40 columns and of its 30 rows
// lie within, and it would refuse the calibration.
TEST_F(Offline, RefusesACropThatTheDaemonRefuses) {
  const Ball ball{.col = 595.25, .row = 445.5, .width = 1200, .height = 900};
  write("reference.png", ball.reference_image());
  write("ball.png", ball.frame());
  const auto cropped = with(calibrate(), "--centre", "600,450", "--force", "--crop");
  EXPECT_THAT([&] { run(with(cropped, "180,200")); },
              ThrowsMessage<std::invalid_argument>(
                  AllOf(HasSubstr("covers 180x200"), HasSubstr("three tenths"))));
  EXPECT_FALSE(fs::exists(at("cal")));
  // The size that the message names.
  run(with(cropped, "300,270"));
  EXPECT_TRUE(fs::exists(at("cal")));
}

}  // namespace
}  // namespace dtact::ctl
