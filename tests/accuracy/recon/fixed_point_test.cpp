// Fixed point against double precision: RMS at most 0.7 µm and never over 5 µm where both trust;
// sharpened, where the wide Gaussian's coarse grid comes in, 1 and 12 µm.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <random>
#include <vector>

#include "clients/calibrate/fit/build.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/files/png.hpp"
#include "tests/accuracy/recon/double_pipeline.hpp"

namespace dtact::recon {
namespace {

namespace fs = std::filesystem;

struct Deviation {
  double rms = 0;
  double most = 0;
  std::size_t trusted = 0;
};

Deviation compare(const Model& model, const std::vector<std::uint16_t>& reference_q8,
                  const std::vector<std::uint8_t>& luma, int steps = 0) {
  const std::vector<double> ideal = reconstruct_in_double(model, reference_q8, luma, steps);
  Reconstructor reconstructor(std::make_shared<Model>(model), steps);
  reconstructor.set_reference(reference_q8);
  std::vector<std::uint8_t> padded = luma;
  padded.resize(luma.size() + 64);
  std::vector<std::int16_t> depth(ideal.size());
  reconstructor.run(padded.data(), model.rectify.frame_width, depth);
  Deviation deviation;
  double squares = 0;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] == kUntrusted || std::isnan(ideal[i])) continue;
    const double error = depth[i] - ideal[i];
    squares += error * error;
    deviation.most = std::max(deviation.most, std::abs(error));
    ++deviation.trusted;
  }
  deviation.rms = std::sqrt(squares / static_cast<double>(deviation.trusted));
  return deviation;
}

void expect_close(const Deviation& deviation, std::size_t min_trusted, const char* what,
                  double rms_um = 0.7, double max_um = 5) {
  fmt::print("{}: RMS {:.3f} um, at most {:.2f} um, {} pixels\n", what, deviation.rms,
             deviation.most, deviation.trusted);
  testing::Test::RecordProperty("rms_um", fmt::format("{:.3f}", deviation.rms));
  testing::Test::RecordProperty("max_um", fmt::format("{:.2f}", deviation.most));
  EXPECT_LE(deviation.rms, rms_um) << what;
  EXPECT_LE(deviation.most, max_um) << what;
  EXPECT_GE(deviation.trusted, min_trusted) << what;
}

/// An invented sensor: vignetted light, a dent with a bulge around it, noise of one grey
/// level.
struct Synthetic {
  static constexpr int kWidth = 200;
  static constexpr int kHeight = 150;
  Model model;
  std::vector<std::uint8_t> luma;

  explicit Synthetic(double light) {
    model.mm_per_px = 0.05;
    model.smoothing_px = 2;
    model.lut.first_q6 = -40 * 64;
    // 32 µm a level where it is pressed, a third where it bulges: the real sensors' slopes.
    for (int q6 = -40 * 64; q6 <= 110 * 64; ++q6) {
      model.lut.um.push_back(static_cast<std::int16_t>(q6 < 0 ? q6 / 6 : q6 / 2));
    }
    model.lut.covered_from_q6 = -30 * 64;
    model.lut.covered_to_q6 = 70 * 64;
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 1);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double r = std::hypot(x - 90, y - 80);
        const double undeformed = 170 - 0.004 * (x * x + y * y) / 10;
        const double change =
            60 * std::exp(-r * r / 800) - 20 * std::exp(-(r - 55) * (r - 55) / 200);
        model.reference_q8.push_back(
            static_cast<std::uint16_t>(std::lround(256 * (undeformed + 0.2 * noise(random)))));
        luma.push_back(
            static_cast<std::uint8_t>(std::lround(light * (undeformed - change) + noise(random))));
      }
    }
    light_q8 = model.reference_q8;
    for (std::uint16_t& value : light_q8) value = static_cast<std::uint16_t>(value * light);
    model.rectify = make_crop_table(kWidth, kHeight, 0, 0, kWidth, kHeight);
  }
  std::vector<std::uint16_t> light_q8;  ///< The reference under the present light.
};

constexpr std::size_t kMax = 29000;  // of 30000 pixels

TEST(FixedPoint, SyntheticIdentity) {
  const Synthetic s(1);
  expect_close(compare(s.model, s.light_q8, s.luma), kMax, "synthetic");
}

TEST(FixedPoint, SyntheticBetweenPixels) {
  Synthetic s(1);
  std::mt19937 random(2);
  std::uniform_int_distribution<int> weight(0, 128);
  for (RectifyTable::Entry& e : s.model.rectify.entries) {
    e.fx = static_cast<std::uint8_t>(weight(random));
    e.fy = static_cast<std::uint8_t>(weight(random));
  }
  expect_close(compare(s.model, s.light_q8, s.luma), kMax, "synthetic, between pixels");
}

TEST(FixedPoint, SyntheticUnderHalfTheLight) {
  const Synthetic s(0.5);
  expect_close(compare(s.model, s.light_q8, s.luma), kMax, "synthetic, half the light");
}

TEST(FixedPoint, SyntheticWithoutSmoothing) {
  Synthetic s(1);
  s.model.smoothing_px = 0;
  expect_close(compare(s.model, s.light_q8, s.luma), kMax, "synthetic, no smoothing");
}

TEST(FixedPoint, Sharpened) {
  for (const int steps : {1, 2}) {
    Synthetic s(0.8);
    // As many pixels as quarter resolution has of a gel of 2 mm.
    s.model.scattering = Scattering{.narrow_mm = 0.061, .wide_mm = 0.37, .narrow_weight = 0.7};
    s.model.sharpened = {{.steps = steps, .lut = s.model.lut, .uncertainty = {}}};
    expect_close(compare(s.model, s.light_q8, s.luma, steps), kMax,
                 fmt::format("synthetic, {} steps", steps).c_str(), 1, 12);
  }
}

TEST(FixedPoint, RealImages) {
  bool any = false;
  for (const char* sensor : {"sensor_a", "sensor_b"}) {
    const fs::path folder = fs::path(DTACT_SHARED_DIR) / "data" / sensor;
    if (!fs::exists(folder)) continue;
    any = true;
    calibration::BallPress press;
    press.reference_q8 = image::read_png_grey16(folder / "ball_reference.png");
    for (std::uint16_t& v : press.reference_q8.pixels) {
      v = static_cast<std::uint16_t>(v * 256 / 257);
    }
    press.frames = {image::read_png_grey8(folder / "ball.png")};
    press.ball_radius_mm = 4;
    press.mm_per_px = 0.051;
    const calibration::Calibration made = calibration::build(press);
    for (const char* frame : {"ball.png", "board.png"}) {
      const Deviation deviation = compare(*made.model, press.reference_q8.pixels,
                                          image::read_png_grey8(folder / frame).pixels);
      expect_close(deviation, 300000, fmt::format("{}, {}", sensor, frame).c_str());
    }
  }
  if (!any) GTEST_SKIP() << "the real images are not beside the repository";
}

}  // namespace
}  // namespace dtact::recon
