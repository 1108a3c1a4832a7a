#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <stdexcept>

#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::calibration {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::size_t entries(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

TEST(CalibrationFolder, EverythingComesBack) {
  const TempFolder temp;
  const Calibration saved = sample();
  save(saved, temp.path() / "cal");
  const Calibration loaded = load(temp.path() / "cal");
  EXPECT_EQ(loaded.name, "cal");
  EXPECT_EQ(loaded.crop_col, 3);
  EXPECT_EQ(loaded.crop_row, 2);
  EXPECT_EQ(loaded.model->method, recon::Method::lut);
  EXPECT_EQ(loaded.model->mm_per_px, 0.051);
  EXPECT_EQ(loaded.model->smoothing_px, 1.5);
  EXPECT_EQ(loaded.model->rectify.frame_width, 12);
  EXPECT_EQ(loaded.model->rectify.frame_height, 9);
  EXPECT_EQ(loaded.model->rectify.width, 6);
  EXPECT_EQ(loaded.model->rectify.height, 5);
  EXPECT_EQ(loaded.model->lut.first_q6, -2);
  EXPECT_EQ(loaded.model->lut.um, saved.model->lut.um);
  EXPECT_EQ(loaded.model->lut.covered_from_q6, -1);
  EXPECT_EQ(loaded.model->lut.covered_to_q6, 2);
  EXPECT_EQ(loaded.gel, sample().gel);
  EXPECT_EQ(loaded.model->scattering, (recon::Scattering{0.28, 1.23, 0.7}));
  ASSERT_EQ(loaded.model->sharpened.size(), 2U);
  const recon::Model::Sharpened& once = loaded.model->sharpened[0];
  EXPECT_EQ(once.steps, 1);
  EXPECT_EQ(once.lut.first_q6, -1);
  EXPECT_EQ(once.lut.um, (std::vector<std::int16_t>{-9, 0, 9, 18}));
  EXPECT_EQ(once.lut.covered_from_q6, 0);
  EXPECT_EQ(once.lut.covered_to_q6, 1);
  ASSERT_EQ(once.uncertainty.size(), 1U);
  EXPECT_EQ(once.uncertainty[0].depth_mm, 0.5);
  EXPECT_EQ(once.uncertainty[0].error_um, 15);
  EXPECT_EQ(loaded.model->sharpened[1].steps, 2);
  EXPECT_TRUE(loaded.model->sharpened[1].uncertainty.empty());
  EXPECT_EQ(loaded.model->reference_q8, saved.model->reference_q8);
  EXPECT_EQ(loaded.model->untrusted, saved.model->untrusted);
  ASSERT_TRUE(loaded.model->force);
  EXPECT_EQ(loaded.model->force->modulus_mpa, 0.125);
  EXPECT_EQ(loaded.model->force->thickness_mm, 2.25);
  EXPECT_EQ(loaded.model->force->zero_mm, -0.0625);
  EXPECT_EQ(loaded.model->force->error_share, 0.03);
  EXPECT_EQ(loaded.model->force->pairs, 12);
  EXPECT_EQ(loaded.model->force->from_n, 0.1);
  EXPECT_EQ(loaded.model->force->to_n, 2);
  EXPECT_EQ(loaded.origin.camera, "usb-0:1.2 \"left\"\\");
  EXPECT_EQ(loaded.origin.pixel_format, "MJPEG");
  EXPECT_EQ(loaded.origin.fps, 59.94);
  ASSERT_EQ(loaded.origin.controls.size(), 2U);
  EXPECT_EQ(loaded.origin.controls[0].name, "exposure absolute");
  EXPECT_EQ(loaded.origin.controls[0].value, 157);
  EXPECT_EQ(loaded.origin.leds, saved.origin.leds);
  EXPECT_EQ(loaded.origin.created, "2026-01-31T12:00:00Z");
  ASSERT_EQ(loaded.origin.sources.size(), 2U);
  EXPECT_EQ(loaded.origin.sources[1].name, "ball_reference.png");
  EXPECT_EQ(loaded.origin.sources[1].sha256, std::string(64, '0'));
}

TEST(CalibrationFolder, ReplacesTheOldOneAndLeavesNothingBeside) {
  const TempFolder temp;
  const fs::path folder = temp.path() / "cal";
  save(sample(), folder);
  Calibration other = sample();
  auto model = std::make_shared<recon::Model>(*other.model);
  model->mm_per_px = 0.04;
  other.model = model;
  save(other, folder.string() + "/");
  EXPECT_EQ(load(folder).model->mm_per_px, 0.04);
  EXPECT_EQ(entries(temp.path()), 1U);
  EXPECT_EQ(entries(folder), 2U);
}

TEST(CalibrationFolder, FollowsALinkToTheFolder) {
  const TempFolder temp;
  save(sample(), temp.path() / "cal");
  fs::create_directory_symlink(temp.path() / "cal", temp.path() / "current");
  save(sample(), temp.path() / "current");
  EXPECT_TRUE(fs::is_symlink(temp.path() / "current"));
  EXPECT_NO_THROW((void)load(temp.path() / "current"));
}

TEST(CalibrationFolder, DoesNotReplaceAnotherFolderOrFile) {
  const TempFolder temp;
  base::write_file_atomically(temp.path() / "thesis.tex", "years");
  EXPECT_THAT([&] { save(sample(), temp.path()); },
              ThrowsMessage<std::runtime_error>(HasSubstr("thesis.tex")));
  EXPECT_THAT([&] { save(sample(), temp.path() / "thesis.tex"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("not a folder")));
  EXPECT_EQ(base::read_file(temp.path() / "thesis.tex"), "years");
  EXPECT_EQ(entries(temp.path()), 1U);
}

TEST(CalibrationFolder, AFailedSaveLeavesTheOldOne) {
  const TempFolder temp;
  save(sample(), temp.path() / "cal");
  Calibration wrong = sample();
  wrong.crop_col = 1;
  EXPECT_THROW(save(wrong, temp.path() / "cal"), std::invalid_argument);
  EXPECT_NO_THROW((void)load(temp.path() / "cal"));
  EXPECT_THROW(save(sample(), temp.path() / "missing" / "cal"), std::runtime_error);
  EXPECT_EQ(entries(temp.path()), 1U);
}

TEST(CalibrationFolder, MissingFolderAndFilesAreNamed) {
  const TempFolder temp;
  EXPECT_THAT([&] { (void)load(temp.path() / "none"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("none: no such folder")));
  EXPECT_THAT([&] { (void)load(temp.path()); },
              ThrowsMessage<std::runtime_error>(HasSubstr("calibration.toml")));
  save(sample(), temp.path() / "cal");
  fs::remove(temp.path() / "cal" / "reference.png");
  EXPECT_THAT([&] { (void)load(temp.path() / "cal"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("reference.png")));
}

TEST(CalibrationFolder, DamagedReferenceIsRefusedByItsChecksum) {
  const TempFolder temp;
  const fs::path folder = temp.path() / "cal";
  save(sample(), folder);
  std::string png = base::read_file(folder / "reference.png");
  png[png.size() / 2] = static_cast<char>(png[png.size() / 2] ^ 1);
  base::write_file_atomically(folder / "reference.png", png);
  EXPECT_THAT([&] { (void)load(folder); },
              ThrowsMessage<std::runtime_error>(HasSubstr("reference.sha256")));
}

TEST(Sha256, KnownDigests) {
  // FIPS 180-2, appendix B.1; and of the empty message.
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

}  // namespace
}  // namespace dtact::calibration
