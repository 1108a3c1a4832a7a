#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "daemon/calibration/sensor_files.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::calibration {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kLens = R"(version = 1

[frame]
width = 800
height = 600

[lens]
homography = [20, 0, 400, 0, 20, 300, 0, 0, 1]
centre_col = 400
centre_row = 300
radius_px = 250
radial = [-0.1, 0.02]
)";

class LensFileTest : public testing::Test {
 protected:
  /// Loads the sample with `from` replaced by `to`.
  [[nodiscard]] LensFile load(const std::string& from = "", const std::string& to = "") const {
    std::string text = kLens;
    if (!from.empty()) text.replace(text.find(from), from.size(), to);
    base::write_file_atomically(path(), text);
    return load_lens(path());
  }
  [[nodiscard]] std::filesystem::path path() const { return temp_.path() / "lens.toml"; }

 private:
  const TempFolder temp_;
};

TEST_F(LensFileTest, IsRead) {
  const LensFile file = load();
  EXPECT_EQ(file.frame_width, 800);
  EXPECT_EQ(file.frame_height, 600);
  EXPECT_EQ(file.lens.homography[2], 400);
  EXPECT_EQ(file.lens.radius_px, 250);
  EXPECT_EQ(file.lens.radial, (std::vector<double>{-0.1, 0.02}));
  EXPECT_EQ(file.gain.shape, recon::GainShape::none) << "files from before there were gains";
  EXPECT_FALSE(file.gain_specified);
}

TEST_F(LensFileTest, HoldsWhereTheCameraStands) {
  LensFile file = load();
  EXPECT_EQ(file.view, CameraView{}) << "a file without it says nothing";
  for (const CameraView& view : {CameraView{{0.3, -0.2}, HeightSource::board, 0, 0.00112, 0.00004},
                                 CameraView{{0.1, 0}, HeightSource::drawing, 0.04, 0, 0}}) {
    file.view = view;
    base::write_file_atomically(path(), format(file));
    EXPECT_EQ(load_lens(path()).view, view);
  }
  const auto refused = [this](const std::string& from, const std::string& to) {
    std::string text = base::read_file(path());
    text.replace(text.find(from), from.size(), to);
    base::write_file_atomically(path(), text);
    (void)load_lens(path());
  };
  EXPECT_THAT(
      [&] { refused("drawing", "guess"); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("lens.toml"), HasSubstr("source"))));
}

TEST_F(LensFileTest, IsReadBackExactly) {
  LensFile file = load();
  file.lens.homography[0] = 20.1;  // no binary fraction
  file.lens.radial = {1.0 / 3, -2.0 / 7};
  file.gain.polynomial = {0, 0, 0.001, -0.0002, 1.0 / 3000};
  file.gain_specified = true;
  file.notes = {"how it was measured"};
  base::write_file_atomically(path(), format(file));
  const LensFile again = load_lens(path());
  EXPECT_EQ(again.lens.homography, file.lens.homography);
  EXPECT_EQ(again.lens.radial, file.lens.radial);
  EXPECT_EQ(again.gain.polynomial, file.gain.polynomial);
}

// A board of pins whose gain is none is an answer; a chessboard gives no answer.
TEST_F(LensFileTest, ReportsNoGainFromNoAnswer) {
  LensFile file = load();
  for (const bool reported : {false, true}) {
    file.gain_specified = reported;
    base::write_file_atomically(path(), format(file));
    EXPECT_EQ(load_lens(path()).gain_specified, reported);
  }
}

TEST_F(LensFileTest, ErrorsNameFileKeyAndFix) {
  const auto says = [](auto... parts) {
    return ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("lens.toml"), HasSubstr(parts)...));
  };
  EXPECT_THAT([&] { (void)load("version = 1", "version = 99"); }, says("version"));
  EXPECT_THAT([&] { (void)load("width = 800\n", ""); }, says("width"));
  EXPECT_THAT([&] { (void)load("300, 0, 0, 1]", "300]"); }, says("homography", "nine numbers"));
  EXPECT_THAT([&] { (void)load("radius_px = 250", "radius_px = 0"); }, says("radius_px"));
  EXPECT_THAT([&] { (void)load("[-0.1, 0.02]", "[0, 0, 0, 0, 0, 0, 0]"); }, says("radial"));
  EXPECT_THAT([&] { (void)load("[-0.1, 0.02]", "[nan]"); }, says("radial"));
  EXPECT_THAT([&] { (void)load("centre_row", "center_row"); }, says("cent"));
  EXPECT_THAT([&] { (void)load("[lens]", "[lens"); }, says("lens"));
  // The surface's origin beside the frame, and mirrored.
  EXPECT_THAT([&] { (void)load("20, 0, 400", "20, 0, 4000"); }, says("lens"));
  EXPECT_THAT([&] { (void)load("[20, 0", "[-20, 0"); }, says("lens"));
}

// A lens counts millimetres from its own origin, a calibration from the middle of its map.
TEST_F(LensFileTest, ACalibrationsFolderHasTheLensAndTheCamerasPlace) {
  Calibration calibration = sample();
  recon::Lens lens;
  lens.homography = {20, 0, 4, 0, 20, 2.25, 0, 0, 1};
  lens.centre_col = 5.5;
  lens.centre_row = 4;
  lens.radius_px = 10;
  auto model = std::make_shared<recon::Model>(*calibration.model);
  std::vector<std::uint8_t> outside;
  model->rectify = make_lens_table(lens, 12, 9, {3, 2, 6, 5, model->mm_per_px}, outside);
  calibration.model = model;
  calibration.lens = lens;
  calibration.view = {.foot_mm = {0.3, -0.2},
                      .source = HeightSource::presses,
                      .per_mm = 0.04,
                      .per_level = 0,
                      .error = 0.003};
  save(calibration, path());
  const LensFile file = load_lens(path());
  EXPECT_EQ(file.frame_width, 12);
  EXPECT_EQ(file.frame_height, 9);
  EXPECT_EQ(file.lens.homography, lens.homography);
  EXPECT_EQ(file.lens.centre_row, 4);
  EXPECT_FALSE(file.gain_specified);
  EXPECT_EQ(file.view.source, HeightSource::presses);
  EXPECT_EQ(file.view.per_mm, 0.04);
  EXPECT_EQ(file.view.error, 0.003);
  // The map's middle is its pixel (2.5, 2), 1.5 and 1.75 pixels of 0.051 mm from the origin.
  EXPECT_NEAR(file.view.foot_mm.x, 0.3 + 0.0765, 1e-9);
  EXPECT_NEAR(file.view.foot_mm.y, -0.2 + 0.08925, 1e-9);
}

TEST_F(LensFileTest, ACalibrationWithoutALensHasNoneToGive) {
  save(sample(), path());
  EXPECT_THAT(
      [&] { (void)load_lens(path()); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("lens.toml"), HasSubstr("has no lens"),
                                              HasSubstr("dtact-calibrate lens"))));
}

TEST_F(LensFileTest, AFolderWithoutALensSaysHowToMakeOne) {
  EXPECT_THAT([&] { (void)load_lens(path().parent_path() / "none.toml"); },
              ThrowsMessage<std::exception>(HasSubstr("none.toml")));
}

}  // namespace
}  // namespace dtact::calibration
