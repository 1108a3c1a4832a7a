#include "daemon/pipeline/reference/gel_marks.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <random>
#include <vector>

namespace dtact::pipeline {
namespace {

constexpr int kWidth = 400;
constexpr int kHeight = 300;
constexpr recon::FrameRegion kPart{20, 10, 360, 280};

/// Spots of three pixels and a quarter of a grey level, at `count` places that `seed` chooses.
struct Spots {
  unsigned seed;
  int count;
};

struct Picture {
  double dx = 0;  ///< Shift of the gel's spots to the right …
  double dy = 0;  ///< … and down.
  double turn = 0;
  double light = 1;
  Spots gel{1, 400};
  Spots camera{2, 0};
  double noise = 0.15;  ///< Of an average of 32 frames, grey levels.
  unsigned noise_seed = 3;
  double stripes = 0;  ///< Height of the camera's stripes, eight pixels apart.
};

GelMarks marks(const Picture& picture) {
  std::vector<double> grey(std::size_t{kWidth} * kHeight);
  const auto at = [&grey](int x, int y) -> double& {
    return grey[static_cast<std::size_t>(y) * kWidth + static_cast<std::size_t>(x)];
  };
  const auto paint = [&](const Spots& spots, double dx, double dy, double turn) {
    std::mt19937 random(spots.seed);
    std::uniform_real_distribution<double> across(-20, kWidth + 20);
    std::uniform_real_distribution<double> down(-20, kHeight + 20);
    for (int i = 0; i < spots.count; ++i) {
      const double u = across(random) - kWidth / 2.0;
      const double v = down(random) - kHeight / 2.0;
      const double cx = kWidth / 2.0 + std::cos(turn) * u - std::sin(turn) * v + dx;
      const double cy = kHeight / 2.0 + std::sin(turn) * u + std::cos(turn) * v + dy;
      for (int y = static_cast<int>(cy) - 5; y <= static_cast<int>(cy) + 5; ++y) {
        for (int x = static_cast<int>(cx) - 5; x <= static_cast<int>(cx) + 5; ++x) {
          if (x < 0 || x >= kWidth || y < 0 || y >= kHeight) continue;
          at(x, y) += 0.25 * std::exp(-0.5 * (std::pow(x - cx, 2) + std::pow(y - cy, 2)) / 2.25);
        }
      }
    }
  };
  paint(picture.gel, picture.dx, picture.dy, picture.turn);
  paint(picture.camera, 0, 0, 0);
  std::mt19937 random(picture.noise_seed);
  std::normal_distribution<double> noise(0, picture.noise);
  std::vector<std::uint16_t> q8;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double smooth = 150 - 0.0003 * (x - 150) * (x - 150) - 0.02 * y;
      const double stripe = x % 8 == 0 ? picture.stripes : 0;
      const double level = picture.light * (smooth + at(x, y)) + stripe + noise(random);
      q8.push_back(static_cast<std::uint16_t>(std::lround(256 * level)));
    }
  }
  return {q8, kWidth, kPart};
}

/// The shift that is found; no shift, which no test expects, when it is not seen.
GelMarks::Move found(const GelMarks& then, const Picture& now) {
  return then.moved_to(marks(now)).value_or(GelMarks::Move{});
}

Picture fresh() { return {.noise_seed = 4}; }

TEST(GelMarks, OfAStillSensorHaveNotMoved) {
  const GelMarks then = marks({});
  EXPECT_FALSE(then.moved_to(then));
  EXPECT_FALSE(then.moved_to(marks(fresh())));
  Picture dimmer = fresh();
  dimmer.light = 0.6;
  EXPECT_FALSE(then.moved_to(marks(dimmer)));
  Picture warmer = fresh();  // like a housing that has warmed up
  warmer.dx = 0.3;
  warmer.dy = -0.2;
  EXPECT_FALSE(then.moved_to(marks(warmer)));
}

TEST(GelMarks, AreFoundWhereTheyWent) {
  const GelMarks then = marks({});
  for (const auto& [x, y] : {std::pair{3, 0}, {0, -3}, {2, 2}, {-7, 5}, {14, -14}}) {
    Picture moved = fresh();
    moved.dx = x;
    moved.dy = y;
    const GelMarks::Move move = found(then, moved);
    EXPECT_NEAR(move.x, x, 1);
    EXPECT_NEAR(move.y, y, 1);
  }
}

// A shift of marks three pixels wide by a fraction of a pixel is already one-sided at two pixels.
TEST(GelMarks, ThatWentAFractionOfAPixelHaveNotMoved) {
  const GelMarks before = marks({});
  for (const double dx : {0.5, -0.6}) {
    EXPECT_FALSE(before.moved_to(marks({.dx = dx, .noise_seed = 4}))) << dx;
    EXPECT_FALSE(before.moved_to(marks({.dy = dx, .noise_seed = 4}))) << dx;
  }
}

TEST(GelMarks, MoveBesideMarksOfTheCameraThatDoNot) {
  Picture picture{.gel = {1, 200}, .camera = {2, 400}, .stripes = 0.5};
  const GelMarks then = marks(picture);
  picture.noise_seed = 4;
  EXPECT_FALSE(then.moved_to(marks(picture)));
  picture.dx = 6;
  picture.dy = -3;
  const GelMarks::Move move = found(then, picture);
  EXPECT_NEAR(move.x, 6, 1);
  EXPECT_NEAR(move.y, -3, 1);
}

TEST(GelMarks, AreFoundTurned) {
  const GelMarks then = marks({});
  for (const double degrees : {1., -2., 4.}) {
    Picture turned = fresh();
    turned.turn = degrees * std::numbers::pi / 180;
    turned.dx = 3;
    const GelMarks::Move move = found(then, turned);
    EXPECT_NEAR(move.turn_deg, degrees, 0.5);
    EXPECT_NEAR(move.x, 3, 1);
    EXPECT_NEAR(move.y, 0, 1);
  }
}

TEST(GelMarks, ThatAreNotThereGiveNoShift) {
  const Picture blank{.gel = {1, 0}, .stripes = 0.5};
  Picture again = blank;
  again.noise_seed = 4;
  EXPECT_FALSE(marks(blank).moved_to(marks(again)));
  Picture another = fresh();  // another gel
  another.gel.seed = 9;
  EXPECT_FALSE(marks({}).moved_to(marks(another)));
  Picture even = blank;
  even.noise = 1e-6;
  EXPECT_FALSE(marks(even).moved_to(marks(even)));
}

TEST(GelMarks, OfTooSmallAPartGiveNoShift) {
  const std::vector<std::uint16_t> q8(std::size_t{80} * 60, 150 * 256);
  const GelMarks small(q8, 80, {10, 5, 60, 50});
  EXPECT_FALSE(small.moved_to(small));
}

}  // namespace
}  // namespace dtact::pipeline
