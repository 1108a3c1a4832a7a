#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "daemon/calibration/calibration.hpp"
#include "daemon/calibration/text.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::calibration {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;
using testing::ThrowsMessage;

/// The sample's text with one place changed.
std::string with(const std::string& from, const std::string& to) {
  std::string toml = format(sample()).toml;
  const auto at = toml.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  if (at != std::string::npos) toml.replace(at, from.size(), to);
  return toml;
}

void expect_refused(const std::string& toml, const std::string& key, const std::string& what) {
  const std::string png = format(sample()).reference_png;
  EXPECT_THAT([&] { (void)parse(toml, png, "upload"); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(StartsWith("upload:"), HasSubstr(key), HasSubstr(what))));
}

TEST(ParseCalibration, TakesTheTwoFilesOfAnUpload) {
  const Files files = format(sample());
  const Calibration calibration = parse(files.toml, files.reference_png, "upload");
  EXPECT_EQ(calibration.name, "");
  EXPECT_EQ(calibration.model->reference_q8, sample().model->reference_q8);
}

TEST(ParseCalibration, NamesFileLineAndKey) {
  // mm_per_px is on line 5.
  expect_refused(with("mm_per_px = 0.051", "mm_per_px = \"wide\""), "upload:5: mm_per_px",
                 "wrong type");
}

TEST(ParseCalibration, RefusesWhatIsNotToml) {
  expect_refused("version = \n", "upload:1", "");
  expect_refused("", "upload:1: version", "missing");
}

TEST(ParseCalibration, AGelIsOptionalAndWhole) {
  const Files files = format(sample());
  std::string without = files.toml;
  const auto begin = without.find("[gel]");
  without.erase(begin, without.find("[uncertainty]") - begin);
  EXPECT_FALSE(parse(without, files.reference_png, "upload").gel);
  expect_refused(with("thickness_mm = [2.1, 0.05]", "thickness_mm = [2.1]"), "gel.thickness_mm",
                 "standard error");
  expect_refused(with("slope = [1.5, 1, ", "slope = [1.5, "), "gel.slope", "five numbers");
}

TEST(ParseCalibration, RefusesImpossibleValues) {
  expect_refused(with("version = 1", "version = 2"), "version", "2 is not allowed");
  expect_refused(with("\"lut\"", "\"magic\""), "method", "\"published\"");
  expect_refused(with("mm_per_px = 0.051", "mm_per_px = 0"), "mm_per_px", "0 is not allowed");
  expect_refused(with("mm_per_px = 0.051", "mm_per_px = nan"), "mm_per_px", "not allowed");
  expect_refused(with("smoothing_px = 1.5", "smoothing_px = -1"), "smoothing_px", "not allowed");
  expect_refused(with("created = \"2026-", "created = \"26-"), "created", "2026-01-31T12:00:00Z");
  expect_refused(with("width = 12", "width = 1"), "frame.width", "from 2");
  expect_refused(with("width = 12", "width = 16385"), "frame.width", "16385 is not allowed");
  expect_refused(with("col = 3", "col = 7"), "crop.width", "from 1 to 5");
  expect_refused(with("row = 2", "row = -2"), "crop.row", "not allowed");
  expect_refused(with("leds = [255,", "leds = [256,"), "light.leds", "entry 1");
  expect_refused(with("leds = [255, ", "leds = ["), "light.leds", "r, g, b");
  expect_refused(with("first_q6 = -2", "first_q6 = 0"), "lut", "lut.covered_from_q6");
  expect_refused(with("covered_to_q6 = 2", "covered_to_q6 = 9"), "lut", "covered_to_q6");
  expect_refused(with("-20, -10, 0", "-20, -10, -11"), "lut", "entry 3");
  expect_refused(with("-20, -10, 0", "-20, 1.5, 0"), "lut.um", "entry 2");
  expect_refused(with("\"gain\" = -3", "\"gain\" = \"low\""), "camera.controls.gain", "wrong type");
  expect_refused(with("sha256 = \"aaaa", "sha256 = \"AAAA"), "source[0].sha256", "hexadecimal");
  expect_refused(with("  0, 1, 7, 2, 29, 1,", "  0, 1, 7, 2, 29, 2,"), "untrusted.runs", "pair 3");
  expect_refused(with("  0, 1, 7, 2, 29, 1,", "  0, 1, 7,"), "untrusted.runs", "pairs");
  // Or 100,000 runs could each mark the whole map, which takes minutes.
  expect_refused(with("  0, 1, 7, 2, 29, 1,", "  0, 9, 7, 2, 29, 1,"), "untrusted.runs", "pair 2");
}

TEST(ParseCalibration, RefusesAreasThatAskForGigabytes) {
  expect_refused(with("width = 12\nheight = 9", "width = 16384\nheight = 16384"), "frame.width",
                 "16384x16384 pixels are more than 67108864");
  std::string toml = with("width = 12\nheight = 9", "width = 8192\nheight = 8192");
  const std::string map = "width = 6\nheight = 5";
  toml.replace(toml.find(map), map.size(), "width = 4096\nheight = 2049");
  expect_refused(toml, "crop.width", "4096x2049 pixels are more than 8388608");
}

TEST(ParseCalibration, RefusesMissingAndUnknownKeys) {
  expect_refused(with("mm_per_px = 0.051", "mm_per_pixel = 0.051"), "mm_per_px", "missing");
  expect_refused(with("version = 1", "version = 1\nextra = 2"), "extra", "unknown key");
  expect_refused(with("col = 3", "col = 3\ncolumn = 3"), "crop.column",
                 "allowed here: col, height, row, width");
  expect_refused(with("[crop]", "[corp]"), "crop", "missing");
}

TEST(ParseCalibration, ReadsBackTheLens) {
  Calibration with_lens = sample();
  recon::Lens lens;
  lens.homography = {20, 0.1, 5, -0.1, 20, 4, 0.001, 0, 1};
  lens.centre_col = 5.5;
  lens.centre_row = 4.25;
  lens.radius_px = 10;
  lens.radial = {0.1, -1.0 / 3};
  auto model = std::make_shared<recon::Model>(*with_lens.model);
  std::vector<std::uint8_t> outside;
  model->rectify = make_lens_table(lens, 12, 9, {3, 2, 6, 5, model->mm_per_px}, outside);
  with_lens.lens = lens;
  with_lens.model = model;
  const Files files = format(with_lens);
  const Calibration back = parse(files.toml, files.reference_png, "upload");
  ASSERT_TRUE(back.lens);
  EXPECT_EQ(back.lens->homography, lens.homography);
  EXPECT_EQ(back.lens->radial, lens.radial);
  EXPECT_EQ(back.lens->centre_row, 4.25);
  EXPECT_EQ(format(back).toml, files.toml);
  expect_refused(with("[lens]", "[lens]\nk1 = 0.1"), "lens.homography", "missing");
}

TEST(ParseCalibration, WhatTheLensDoesNotSeeIsUntrustedBesideTheMask) {
  Calibration with_lens = sample();
  recon::Lens lens;
  // A pixel of the map is three of the frame, 12×9: the map's rim is outside.
  lens.homography = {60, 0, 5.5, 0, 60, 4, 0, 0, 1};
  lens.centre_col = 5.5;
  lens.centre_row = 4;
  lens.radius_px = 10;
  auto model = std::make_shared<recon::Model>(*with_lens.model);
  std::vector<std::uint8_t> outside;
  model->rectify = make_lens_table(lens, 12, 9, {3, 2, 6, 5, model->mm_per_px}, outside);
  with_lens.lens = lens;
  with_lens.model = model;
  const Files files = format(with_lens);
  const std::vector<std::uint8_t> expected = {1, 1, 1, 1, 1, 1,  //
                                              1, 1, 1, 0, 0, 1,  // the mask has two inside
                                              1, 0, 0, 0, 0, 1,  //
                                              1, 0, 0, 0, 0, 1,  //
                                              1, 1, 1, 1, 1, 1};
  EXPECT_EQ(parse(files.toml, files.reference_png, "upload").model->untrusted, expected);
}

TEST(ParseCalibration, ASurfaceIsCheckedAndMayBeAbsent) {
  const Calibration plain = sample();
  const std::string png = format(plain).reference_png;
  const std::string finger =
      "[surface]\nshape = \"cylinder\"\nradius_mm = 12.5\naxis_deg = 90\nair_mm = 20\n"
      "gel_mm = 8\nrefraction = 1.41\n";
  using Kind = recon::Surface::Kind;
  const auto surface_in = [&](const std::string& table) {
    std::string toml = format(plain).toml;
    const auto begin = toml.find("[surface]");
    toml.replace(begin, toml.find('\n', begin) + 1 - begin, table);
    return parse(toml, png, "upload").model->surface;
  };
  EXPECT_EQ(surface_in(""), recon::Surface{});
  const recon::Surface expected{Kind::cylinder, 12.5, 90, 20, 8, 1.41};
  EXPECT_EQ(surface_in(finger), expected);
  Calibration curved = plain;
  auto model = std::make_shared<recon::Model>(*plain.model);
  model->surface = {Kind::sphere, 15, 0, 20, 8, 1.41};
  curved.model = model;
  const Files files = format(curved);
  EXPECT_EQ(parse(files.toml, files.reference_png, "upload").model->surface, model->surface);
  const auto refused = [&](const std::string& table, const char* key) {
    EXPECT_THAT([&] { (void)surface_in(table); },
                ThrowsMessage<std::runtime_error>(HasSubstr(key)));
  };
  refused("[surface]\nshape = \"cube\"\n", "surface.shape");
  refused("[surface]\nshape = \"sphere\"\nradius_mm = 0\n", "surface.radius_mm");
}

/// The sample under a camera 25 mm above its surface.
Calibration seen_from(HeightSource source) {
  Calibration seen = sample();
  seen.view = {
      .foot_mm = {0.3, -0.2}, .source = source, .per_mm = 0.04, .per_level = 0, .error = 0.003};
  return seen;
}

TEST(ParseCalibration, KnowsWhereTheCameraStands) {
  for (const HeightSource source :
       {HeightSource::assumed, HeightSource::board, HeightSource::drawing, HeightSource::presses}) {
    const Calibration seen = seen_from(source);
    const Files files = format(seen);
    const Calibration back = parse(files.toml, files.reference_png, "upload");
    EXPECT_EQ(back.view, seen.view);
    EXPECT_EQ(back.model->surface.view, (recon::Viewpoint{{0.3, -0.2}, 0.04}));
    EXPECT_EQ(format(back).toml, files.toml);
  }
  const Files plain = format(sample());
  const Calibration unknown = parse(plain.toml, plain.reference_png, "upload");
  EXPECT_EQ(unknown.view, CameraView{});
  EXPECT_EQ(unknown.model->surface.view, recon::Viewpoint{}) << "depth is placed as it is seen";
}

TEST(ParseCalibration, BehindACurvedSurfaceThatSaysWhereTheCameraStands) {
  Calibration curved = seen_from(HeightSource::drawing);
  auto model = std::make_shared<recon::Model>(*curved.model);
  model->surface = {recon::Surface::Kind::sphere, 15, 0, 20, 8, 1.41};
  curved.model = model;
  const Files files = format(curved);
  const Calibration back = parse(files.toml, files.reference_png, "upload");
  EXPECT_EQ(back.view, curved.view);
  EXPECT_EQ(back.model->surface, model->surface);
  EXPECT_EQ(back.model->surface.view, recon::Viewpoint{});
}

TEST(ParseCalibration, TheCamerasPlaceIsChecked) {
  const Files files = format(seen_from(HeightSource::board));
  const auto seen_with = [&files](const std::string& from, const std::string& to) {
    std::string toml = files.toml;
    const auto table = toml.find("[viewpoint]");
    toml.replace(toml.find(from, table), from.size(), to);
    return parse(toml, files.reference_png, "upload").view;
  };
  const auto refused = [&](const std::string& from, const std::string& to, const char* key,
                           const char* what) {
    EXPECT_THAT([&] { (void)seen_with(from, to); },
                ThrowsMessage<std::runtime_error>(
                    AllOf(StartsWith("upload:"), HasSubstr(key), HasSubstr(what))));
  };
  EXPECT_EQ(seen_with("per_mm = 0.04", "per_mm = 0.2").per_mm, 0.2);
  EXPECT_EQ(seen_with("[0.3, -0.2]", "[100, -100]").foot_mm, (recon::Point{100, -100}));
  refused("per_mm = 0.04", "per_mm = 0.21", "viewpoint.per_mm", "to 0.2");
  refused("per_mm = 0.04", "per_mm = 0", "viewpoint.per_mm", "above 0");
  // A board's share for each grey level is not a height until a LUT is made.
  refused("per_mm = 0.04", "per_level = 0.001", "viewpoint.per_mm", "above 0");
  refused("[0.3, -0.2]", "[0.3, -100.5]", "viewpoint.foot", "entry 2");
  refused("[0.3, -0.2]", "[0.3]", "viewpoint.foot", "x and y");
  refused("\"board\"", "\"unknown\"", "viewpoint.source", "\"presses\"");
  refused("\"board\"", "\"ruler\"", "viewpoint.source", "\"presses\"");
  refused("error = 0.003", "error = -0.003", "viewpoint.error", "from 0 to 1");
}

TEST(ParseCalibration, WidthsAndHeightsHaveLimitsOfTheirOwn) {
  expect_refused(with("height = 9", "height = 1"), "frame.height", "from 2");
  expect_refused(with("col = 3", "col = 12"), "crop.col", "from 0 to 11");
  expect_refused(with("row = 2", "row = 9"), "crop.row", "from 0 to 8");
  expect_refused(with("width = 6", "width = 10"), "crop.width", "from 1 to 9");
  expect_refused(with("height = 5", "height = 8"), "crop.height", "from 1 to 7");
  expect_refused(with("height = 5", "height = 0"), "crop.height", "from 1 to 7");
}

TEST(ParseCalibration, GainAndUncertaintyAreCheckedAndMayBeAbsent) {
  expect_refused(with("\"radial\"", "\"square\""), "gain.shape", "\"uniform\"");
  expect_refused(with("per_mm = -0.0125", "per_mm = -2"), "gain.per_mm", "from -1 to 1");
  expect_refused(with("per_mm = -0.0125", ""), "gain.per_mm", "missing");
  expect_refused(with("polynomial = [0.015625, -0.5]", "polynomial = [0.015625]"),
                 "gain.polynomial", "two numbers");
  expect_refused(with("polynomial = [0.015625, -0.5]", "polynomial = [0.015625, -0.5, 0]"),
                 "gain.polynomial", "five");
  expect_refused(with("  0.25, 1.1,", "  1.1, 0.25,"), "uncertainty.depth_mm", "ascending");
  expect_refused(with("  0.25, 1.1,", "  0.25,"), "uncertainty.error_um", "one for each");
  expect_refused(with("  12.5, 20,", "  12.5, -1,"), "uncertainty.error_um", "entry 2");
  const Files files = format(sample());
  std::string old = files.toml;
  const auto from = old.find("[gain]");
  old.replace(from, old.find("# Indentation", from) - from, "[gain]\n");
  old.resize(old.find("[[sharpened]]"));
  const Calibration parsed = parse(old, files.reference_png, "upload");
  EXPECT_EQ(parsed.model->gain.shape, recon::GainShape::none);
  EXPECT_TRUE(parsed.model->uncertainty.empty());
  EXPECT_FALSE(parsed.model->scattering);
  EXPECT_TRUE(parsed.model->sharpened.empty());
}

TEST(ParseCalibration, ForceIsCheckedAndMayBeAbsent) {
  expect_refused(with("modulus_mpa = 0.125", ""), "force.modulus_mpa", "missing");
  expect_refused(with("thickness_mm = 2.25", "thickness_mm = 0.2"), "force.thickness_mm", "0.5 to");
  expect_refused(with("to_n = 2", "to_n = 0.05"), "force.to_n", "from 0.1");
  const Files files = format(sample());
  std::string old = files.toml;
  const auto from = old.find("[force]");
  old.erase(from, old.find("[lens]") - from);
  EXPECT_FALSE(parse(old, files.reference_png, "upload").model->force);
}

TEST(ParseCalibration, ScatteringIsChecked) {
  expect_refused(with("narrow_mm = 0.28", "narrow_mm = 0.001"), "scattering.narrow_mm",
                 "from 0.01 to 5");
  expect_refused(with("narrow_mm = 0.28", "narrow_mm = 1.5"), "scattering.wide_mm",
                 "above narrow_mm");
  expect_refused(with("wide_mm = 1.23", "wide_mm = 20.5"), "scattering.wide_mm", "to 20");
  expect_refused(with("narrow_weight = 0.7", "narrow_weight = 1.01"), "scattering.narrow_weight",
                 "from 0 to 1");
  expect_refused(with("narrow_weight = 0.7", ""), "scattering.narrow_weight", "missing");
  expect_refused(with("narrow_weight = 0.7", "weight = 0.7\nnarrow_weight = 0.7"),
                 "scattering.weight", "unknown key");
}

TEST(ParseCalibration, SharpenedLutsAreChecked) {
  expect_refused(with("\nsteps = 1", "\nsteps = 0"), "sharpened[0].steps", "from 1 to 2");
  expect_refused(with("\nsteps = 2", "\nsteps = 3"), "sharpened[1].steps", "from 1 to 2");
  expect_refused(with("\nsteps = 2", "\nsteps = 1"), "sharpened[1].steps", "which has 1");
  expect_refused(with("-9, 0, 9", "-9, 0, -10"), "sharpened[0]", "entry 3");
  expect_refused(with("-8, -4, -1, 0,", "-8,"), "sharpened[1]", "lut.covered_from_q6");
  expect_refused(with("  0.5,", "  0.5, 0.6,"), "sharpened[0].error_um", "one for each");
  expect_refused(with("\nsteps = 2", "\nsteps = 2\nradius = 1"), "sharpened[1].radius",
                 "unknown key");
}

TEST(ParseCalibration, SharpenedLutsNeedTheirScattering) {
  const std::string toml = format(sample()).toml;
  const auto from = toml.find("[scattering]");
  const std::string without = toml.substr(0, from) + toml.substr(toml.find("# Indentation", from));
  expect_refused(without, "sharpened[0]", "[scattering]");
  expect_refused(with("method = \"lut\"", "method = \"published\""), "sharpened[0]",
                 "\"published\" has no sharpened LUTs");
}

TEST(ParseCalibration, RefusesAnotherReference) {
  const Files files = format(sample());
  const std::string other =
      image::encode_png(image::Grey16{12, 9, std::vector<std::uint16_t>(108, 1)});
  EXPECT_THAT([&] { (void)parse(files.toml, other, "upload"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("reference.sha256")));
}

/// The sample with `png` as its reference and the checksum to match.
void expect_reference_refused(const std::string& png, const std::string& what) {
  const Files files = format(sample());
  std::string toml = files.toml;
  const std::string digest = sha256_hex(files.reference_png);
  toml.replace(toml.find(digest), digest.size(), sha256_hex(png));
  EXPECT_THAT([&] { (void)parse(toml, png, "upload"); },
              ThrowsMessage<std::runtime_error>(HasSubstr(what)));
}

TEST(ParseCalibration, RefusesAReferenceThatCannotBe) {
  expect_reference_refused("not a PNG", "reference.png");
  expect_reference_refused(
      image::encode_png(image::Grey16{12, 10, std::vector<std::uint16_t>(120, 1)}), "12x10");
  expect_reference_refused(
      image::encode_png(image::Grey16{13, 9, std::vector<std::uint16_t>(117, 1)}), "13x9");
  expect_reference_refused(
      image::encode_png(image::Grey16{12, 9, std::vector<std::uint16_t>(108, 65281)}), "65280");
  expect_reference_refused(
      image::encode_png(image::Grey8{12, 9, std::vector<std::uint8_t>(108, 1)}), "16-bit grey");
  expect_reference_refused(image::encode_png(image::Rgb8{12, 9, std::vector<std::uint8_t>(324, 1)}),
                           "16-bit grey");
}

TEST(ParseCalibration, RefusesAnotherFrameThanTheCameras) {
  const Files files = format(sample());
  const auto read = [&](FrameSize camera) {
    return parse(files.toml, files.reference_png, "upload", camera);
  };
  EXPECT_EQ(read({12, 9}).model->rectify.frame_width, 12);
  EXPECT_THAT([&] { (void)read({9, 12}); },
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("frame: is for frames of 12x9 pixels, the camera delivers 9x12: set")));
}

TEST(FrameSize, GivesFramesOfItsOwnSizeAndOfItsJpegs) {
  const FrameSize whole{.width = 12, .height = 9};
  EXPECT_TRUE(whole.gives(12, 9));
  EXPECT_FALSE(whole.gives(12, 10));
  EXPECT_FALSE(whole.gives(13, 9));
  const FrameSize decoded{.width = 4, .height = 3, .decode_scale = 3};
  EXPECT_TRUE(decoded.gives(4, 3));
  EXPECT_TRUE(decoded.gives(12, 9));
  EXPECT_FALSE(decoded.gives(12, 3));
  EXPECT_FALSE(decoded.gives(4, 9));
  EXPECT_FALSE(decoded.gives(12, 10));
  EXPECT_FALSE(decoded.gives(11, 9));
  EXPECT_EQ(whole.text(), "12x9");
  EXPECT_EQ(decoded.text(), "4x3 (decoded from 12x9)");
}

TEST(FormatCalibration, RefusesAnotherRectificationThanTheCrop) {
  Calibration calibration = sample();
  auto model = std::make_shared<recon::Model>(*calibration.model);
  model->rectify.entries[3].fx = 5;
  calibration.model = model;
  EXPECT_THROW((void)format(calibration), std::invalid_argument);
}

}  // namespace
}  // namespace dtact::calibration
