// Calibration and evaluation on real images of two sensors of the family (none of this project's
// own): the press of a 4 mm ball.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

#include "clients/calibrate/fit/build.hpp"
#include "clients/calibrate/fit/evaluate.hpp"
#include "hal/files/png.hpp"

namespace dtact::calibration {
namespace {

namespace fs = std::filesystem;

std::optional<BallPress> real_press(const char* sensor, double mm_per_px) {
  const fs::path folder = fs::path(DTACT_SHARED_DIR) / "data" / sensor;
  if (!fs::exists(folder)) return std::nullopt;
  BallPress press;
  press.reference_q8 = image::read_png_grey16(folder / "ball_reference.png");
  // 65535 is grey level 255, in Q8 65280.
  for (std::uint16_t& v : press.reference_q8.pixels) {
    v = static_cast<std::uint16_t>((v * 256 + 128) / 257);
  }
  press.frames = {image::read_png_grey8(folder / "ball.png")};
  press.ball_radius_mm = 4;
  press.mm_per_px = mm_per_px;
  return press;
}

Evaluation judge(const BallPress& press, const char* what) {
  const Calibration made = build(press);
  const Evaluation e = evaluate(made, press.reference_q8.pixels, press.frames, 4);
  fmt::print("{}: MAE {:.4f} mm, with the offset of {:+.4f} mm {:.4f} mm", what, e.mae_mm,
             e.offset_mm, e.raw_mae_mm);
  if (e.half_mae_mm) {
    fmt::print(", half-disc {:.4f} mm, at worst {:.4f} mm", *e.half_mae_mm,
               e.half_worst_mm.value_or(0));
  }
  fmt::print(", untrusted {} of {}\n", e.untrusted, e.pixels);
  testing::Test::RecordProperty(std::string(what) + "_mae_mm", fmt::format("{:.4f}", e.mae_mm));
  testing::Test::RecordProperty(std::string(what) + "_half_mm",
                                fmt::format("{:.4f}", e.half_mae_mm.value_or(0)));
  EXPECT_LE(static_cast<double>(e.untrusted), 0.01 * static_cast<double>(e.pixels)) << what;
  return e;
}

TEST(RealImages, SensorAWithinItsBounds) {
  const std::optional<BallPress> press = real_press("sensor_a", 0.0510);
  if (!press) GTEST_SKIP() << "the real images are not beside the repository";
  const Evaluation e = judge(*press, "sensor_a");
  EXPECT_LE(e.mae_mm, 0.016);
  EXPECT_LE(e.half_mae_mm.value_or(1), 0.019);
  EXPECT_LE(e.half_worst_mm.value_or(1), 0.019);
  // The weighted centroid; the smallest enclosing circle is 0.1 mm off.
  EXPECT_NEAR(e.contact.row, 256.1, 0.5);
  EXPECT_NEAR(e.contact.col, 341.3, 0.5);
  EXPECT_NEAR(e.contact.radius_mm, 3.4, 0.05);
  EXPECT_EQ(e.drift_levels, 0) << "uneven outskirts are no drift";
}

TEST(RealImages, SensorAWithADriftedReference) {
  std::optional<BallPress> press = real_press("sensor_a", 0.0510);
  if (!press) GTEST_SKIP() << "the real images are not beside the repository";
  // Six levels exceed the outskirts' unevenness (1.5); the sensor's own drift is 2.
  for (std::uint16_t& v : press->reference_q8.pixels) v = static_cast<std::uint16_t>(v + 6 * 256);
  const Evaluation e = judge(*press, "sensor_a_drifted");
  EXPECT_NEAR(e.drift_levels, 6, 2.5);
  EXPECT_LE(e.mae_mm, 0.016);
  EXPECT_LE(e.half_mae_mm.value_or(1), 0.019);
}

TEST(RealImages, SensorACropped) {
  std::optional<BallPress> press = real_press("sensor_a", 0.0510);
  if (!press) GTEST_SKIP() << "the real images are not beside the repository";
  press->crop = Crop{327 - 230, 240 - 172, 460, 345};
  const Evaluation e = judge(*press, "sensor_a_cropped");
  EXPECT_LE(e.mae_mm, 0.016);
  EXPECT_LE(e.half_mae_mm.value_or(1), 0.019);
}

TEST(RealImages, SensorAPublished) {
  std::optional<BallPress> press = real_press("sensor_a", 0.0510);
  if (!press) GTEST_SKIP() << "the real images are not beside the repository";
  press->method = recon::Method::published;
  const Evaluation published = judge(*press, "sensor_a_published");
  press->method = recon::Method::lut;
  const Evaluation lut = judge(*press, "sensor_a");
  EXPECT_LT(lut.mae_mm, published.mae_mm);
}

// The hard case: the press is off its axis and the bulge asymmetric, so that no LUT of one variable
// fits. The bound only detects that it gets worse.
TEST(RealImages, SensorBReported) {
  const std::optional<BallPress> press = real_press("sensor_b", 0.05317);
  if (!press) GTEST_SKIP() << "the real images are not beside the repository";
  const Evaluation e = judge(*press, "sensor_b");
  EXPECT_LE(e.mae_mm, 0.08);
  EXPECT_LE(e.half_mae_mm.value_or(1), 0.1);
}

}  // namespace
}  // namespace dtact::calibration
