#include "hal/sim/elastic_layer.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace dtact::hal::sim {
namespace {

constexpr int kSize = 320;
constexpr double kSpacing = 0.125;

// A ball of radius 4 mm in the middle of a 40 mm square.
cv::Mat1d ball_target(double depth_mm) {
  cv::Mat1d target(kSize, kSize, -1e3);
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      const double r = std::hypot(i - kSize / 2, j - kSize / 2) * kSpacing;
      if (r < 4) target(i, j) = depth_mm - (4 - std::sqrt(16 - r * r));
    }
  }
  return target;
}

struct Radii {
  double contact = 0;
  double zero = 0;
  double bulge = 0;
};

Radii radii_of(const Pressed& pressed) {
  Radii radii;
  double lowest = 0;
  for (int j = kSize / 2; j < kSize; ++j) {
    const int points = j - kSize / 2;
    const double r = points * kSpacing;
    const double u = pressed.indentation_mm(kSize / 2, j);
    if (pressed.pressure(kSize / 2, j) > 0) radii.contact = r;
    if (radii.zero == 0 && u < 0) {
      const double before = pressed.indentation_mm(kSize / 2, j - 1);
      radii.zero = r - kSpacing * u / (u - before);
    }
    if (u < lowest) {
      lowest = u;
      radii.bulge = r;
    }
  }
  return radii;
}

// physics.md: a ball of 4 mm pressed 1.7 mm into h = 2.0…2.5 mm puts the zero at 3.3–3.4 mm and the
// bulge's maximum at 4.2–4.5 mm.
TEST(ElasticLayer, BulgesWhereTheRealSensorDoes) {
  const ElasticLayer gel(kSize, kSize, kSpacing, 2.5);
  const Radii radii = radii_of(gel.solve(ball_target(1.7), {}));
  EXPECT_NEAR(radii.zero, 3.35, 0.05);
  EXPECT_GE(radii.bulge, 4.2);
  EXPECT_LE(radii.bulge, 4.5);
}

// physics.md: at 1.5 mm the contact's radius is 3.04 mm, the geometric circle's 3.12.
TEST(ElasticLayer, ContactRadiusIsNearTheGeometricCircle) {
  const ElasticLayer gel(kSize, kSize, kSpacing, 2.0);
  EXPECT_NEAR(radii_of(gel.solve(ball_target(1.5), {})).contact, 3.04, kSpacing);
}

TEST(ElasticLayer, KeepsItsVolume) {
  const ElasticLayer gel(kSize, kSize, kSpacing, 2.0);
  const Pressed pressed = gel.solve(ball_target(1.0), {});
  EXPECT_NEAR(cv::sum(pressed.indentation_mm)[0], 0, 1e-6);
}

TEST(ElasticLayer, ContactPushesAndNeverPulls) {
  const ElasticLayer gel(kSize, kSize, kSpacing, 2.0);
  const cv::Mat1d target = ball_target(1.0);
  const Pressed pressed = gel.solve(target, {});
  int in_contact = 0;
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      ASSERT_GE(pressed.pressure(i, j), 0);
      const double gap = pressed.indentation_mm(i, j) - target(i, j);
      ASSERT_GT(gap, -1e-4);
      if (pressed.pressure(i, j) > 0) {
        ASSERT_LT(gap, 1e-4);
        ++in_contact;
      }
    }
  }
  EXPECT_GT(in_contact, 1000);
}

TEST(ElasticLayer, IsLinear) {
  const ElasticLayer gel(64, 64, 0.25, 2.0);
  cv::Mat1d a(64, 64, 0.0);
  cv::Mat1d b(64, 64, 0.0);
  a(20, 30) = 1;
  b(40, 10) = 2;
  const cv::Mat1d both = gel.indentation(cv::Mat1d(a + b));
  const cv::Mat1d apart = cv::Mat1d(gel.indentation(a) + gel.indentation(b));
  EXPECT_LT(cv::norm(both, apart, cv::NORM_INF), 1e-12);
}

// C(k) = 3/(2k) · (sinh 4 − 4)/(cosh 4 + 1 + 8) at kh = 2, computed by hand: 27.2899 − 4 over
// 27.3082 + 9 is 0.64145; h = 2 mm, so k = 1 per mm.
TEST(ElasticLayer, AnswersACosineWithItsCompliance) {
  constexpr int kN = 64;
  const double spacing = 2 * 3.14159265358979 * 4 / kN;  // four waves of k = 1 per mm
  const ElasticLayer gel(kN, kN, spacing, 2.0);
  cv::Mat1d p(kN, kN);
  for (int i = 0; i < kN; ++i) {
    for (int j = 0; j < kN; ++j) p(i, j) = std::cos(j * spacing);
  }
  EXPECT_NEAR(gel.indentation(p)(5, 0), 1.5 * 0.64145, 1e-4);
  EXPECT_NEAR(gel.indentation(cv::Mat1d(p.t()))(0, 5), 1.5 * 0.64145, 1e-4);
}

// E. K. Dimitriadis et al., "Determination of elastic moduli of thin gels of soft material using
// the atomic force microscope", Biophysical Journal 82 (2002): on a bonded gel with ν = 0.5
// Hertz' 16/9 E √R d^1.5 is multiplied by 1 + 1.133 χ + 1.283 χ² + 0.769 χ³ + 0.0975 χ⁴, χ = √(R
// d)/h. R = 2, d = 0.1, h = 1.5: 0.0795 · 1.473.
TEST(ElasticLayer, PressureAddsUpToTheForceOnABondedLayer) {
  constexpr int kN = 256;
  constexpr double kFine = 0.03;
  cv::Mat1d target(kN, kN);
  for (int i = 0; i < kN; ++i) {
    for (int j = 0; j < kN; ++j) {
      const double r = std::hypot(i - kN / 2, j - kN / 2) * kFine;
      target(i, j) = r < 2 ? 0.1 - (2 - std::sqrt(4 - r * r)) : -1e3;
    }
  }
  const ElasticLayer gel(kN, kN, kFine, 1.5);
  const double force = cv::sum(gel.solve(target, {}).pressure)[0] * kFine * kFine;
  EXPECT_NEAR(force, 0.1171, 0.03 * 0.1171);
}

// The same for ν = 0.45: 2(1 − 0.2025) = 1.595; 1.2 · 27.2899 − 4 over 1.2 · 27.3082 + 1.22 + 8 is
// 0.68464. And C(0) = 2 · 1.45 · 0.1 / 0.55 = 0.52727.
TEST(ElasticLayer, ThatCanBeCompressedGivesWay) {
  constexpr int kN = 64;
  const double spacing = 2 * 3.14159265358979 * 4 / kN;
  const ElasticLayer gel(kN, kN, spacing, 2.0, 0.45);
  cv::Mat1d p(kN, kN);
  for (int i = 0; i < kN; ++i) {
    for (int j = 0; j < kN; ++j) p(i, j) = std::cos(j * spacing);
  }
  EXPECT_NEAR(gel.indentation(p)(5, 0), 1.595 * 0.68464, 1e-4);
  EXPECT_NEAR(gel.indentation(cv::Mat1d(kN, kN, 1.0))(7, 9), 0.52727, 1e-5);
}

TEST(ElasticLayer, StaysFlatWithoutContact) {
  const ElasticLayer gel(64, 64, 0.25, 2.0);
  const Pressed pressed = gel.solve(cv::Mat1d(64, 64, -1.0), {});
  EXPECT_EQ(cv::norm(pressed.indentation_mm, cv::NORM_INF), 0);
}

TEST(ElasticLayer, RefusesAPressThatFillsTheGrid) {
  const ElasticLayer gel(32, 32, 0.25, 2.0);
  EXPECT_THROW((void)gel.solve(cv::Mat1d(32, 32, 1.0), {}), std::runtime_error);
}

TEST(ElasticLayer, FindsTheSameContactFromAnyStart) {
  const ElasticLayer gel(kSize, kSize, kSpacing, 2.0);
  const Pressed shallow = gel.solve(ball_target(0.5), {});
  const Pressed warm = gel.solve(ball_target(1.0), shallow.pressure);
  const Pressed cold = gel.solve(ball_target(1.0), {});
  EXPECT_LT(cv::norm(warm.indentation_mm, cold.indentation_mm, cv::NORM_INF), 1e-3);
}

}  // namespace
}  // namespace dtact::hal::sim
