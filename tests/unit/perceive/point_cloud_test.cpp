#include "clients/geometry/point_cloud.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <stdexcept>

namespace dtact::perceive {
namespace {

using Kind = recon::Surface::Kind;

struct Map {
  Map(int width, int height, double mm_per_px) {
    grid.width = grid.full_width = width;
    grid.height = grid.full_height = height;
    grid.mm_per_px = mm_per_px;
    values.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
    grid.values = values;
  }
  std::int16_t& at(int row, int column) {
    return values[static_cast<std::size_t>(row * grid.width + column)];
  }
  /// A part of the map.
  Map cut(int x, int y, int width, int height) {
    Map part(width, height, grid.mm_per_px);
    part.grid.x = x;
    part.grid.y = y;
    part.grid.full_width = grid.full_width;
    part.grid.full_height = grid.full_height;
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) {
        part.at(row, column) = at(y + row, x + column);
      }
    }
    return part;
  }
  DepthGrid grid;
  std::vector<std::int16_t> values;
};

/// A ball of `radius` mm pressed `deepest` mm at the middle, micrometres; 0 beside it.
Map ball_press(double radius, double deepest, int size, double mm_per_px) {
  Map map(size, size, mm_per_px);
  for (int row = 0; row < size; ++row) {
    for (int column = 0; column < size; ++column) {
      const double x = (column - 0.5 * (size - 1)) * mm_per_px;
      const double y = (row - 0.5 * (size - 1)) * mm_per_px;
      const double depth =
          deepest - radius + std::sqrt(std::max(0.0, radius * radius - x * x - y * y));
      map.at(row, column) = static_cast<std::int16_t>(std::lround(1000 * std::max(0.0, depth)));
    }
  }
  return map;
}

double degrees_between(const Vector& a, const Vector& b) {
  const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return std::acos(std::clamp(dot, -1.0, 1.0)) * 180 / std::numbers::pi;
}

Vector vector_at(const PointCloud& cloud, std::size_t index, PointCloud::Part first) {
  return {cloud.values[first * cloud.size() + index],
          cloud.values[(first + 1U) * cloud.size() + index],
          cloud.values[(first + 2U) * cloud.size() + index]};
}

// A ball of 5 mm, 1 mm deep at (5, −3), as a camera 25 mm above (−0.5, 0.3) shows it: the points
// and normals are the ball's.
TEST(PointCloud, PointsLieWhereTheyAreUnderACameraThatIsNear) {
  const recon::Surface surface{.view = {{-0.5, 0.3}, 1.0 / 25}};
  const auto depth_at = [](recon::Point mm) {
    return -4 + std::sqrt(std::max(0.0, 25 - std::pow(mm.x - 5, 2) - std::pow(mm.y + 3, 2)));
  };
  Map map(500, 400, 0.0417);
  for (int row = 0; row < 400; ++row) {
    for (int column = 0; column < 500; ++column) {
      const recon::Point seen{(column - 249.5) * 0.0417, (row - 199.5) * 0.0417};
      double depth = 0;
      for (int round = 0; round < 30; ++round) {
        depth = std::max(0.0, depth_at(surface.view.place(seen, depth)));
      }
      map.at(row, column) = static_cast<std::int16_t>(std::lround(1000 * depth));
    }
  }
  PointCloud cloud;
  CloudMaker(surface).make(map.grid, 1, cloud);
  int pressed = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (map.values[i] < 200) continue;  // the normals' neighbours lie on the ball, too
    ++pressed;
    const Vector at = vector_at(cloud, i, PointCloud::kX);
    const Vector inwards{5e-3 - at[0], -3e-3 - at[1], 4e-3 - at[2]};
    ASSERT_NEAR(std::hypot(inwards[0], inwards[1], inwards[2]), 5e-3, 2e-6);
    ASSERT_LT(degrees_between(vector_at(cloud, i, PointCloud::kNormalX),
                              {inwards[0] / 5e-3, inwards[1] / 5e-3, inwards[2] / 5e-3}),
              1);
  }
  EXPECT_GT(pressed, 10000);
}

TEST(PointCloud, AFlatMapIsAPlane) {
  Map map(5, 3, 0.5);
  PointCloud cloud;
  CloudMaker().make(map.grid, 1, cloud);
  ASSERT_EQ(cloud.width, 5);
  ASSERT_EQ(cloud.height, 3);
  ASSERT_EQ(cloud.values.size(), 90U);
  EXPECT_FLOAT_EQ(cloud.part(PointCloud::kX)[0], -1e-3F);
  EXPECT_FLOAT_EQ(cloud.part(PointCloud::kX)[4], 1e-3F);
  EXPECT_FLOAT_EQ(cloud.part(PointCloud::kY)[0], -0.5e-3F);
  EXPECT_FLOAT_EQ(cloud.part(PointCloud::kY)[14], 0.5e-3F);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(cloud.part(PointCloud::kZ)[i], 0);
    EXPECT_EQ(cloud.part(PointCloud::kNormalX)[i], 0);
    EXPECT_EQ(cloud.part(PointCloud::kNormalY)[i], 0);
    EXPECT_FLOAT_EQ(cloud.part(PointCloud::kNormalZ)[i], 1);
  }
}

// One millimetre deeper for each to the right: the surface falls at 45° and faces right.
TEST(PointCloud, ASlopesNormalAlsoAtTheMapsEnds) {
  Map map(9, 4, 0.1);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 9; ++column) {
      map.at(row, column) = static_cast<std::int16_t>(100 * column);
    }
  }
  PointCloud cloud;
  CloudMaker().make(map.grid, 1, cloud);
  EXPECT_FLOAT_EQ(cloud.part(PointCloud::kZ)[8], -0.8e-3F);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_NEAR(cloud.part(PointCloud::kNormalX)[i], 0.70711, 1e-5) << i;
    EXPECT_NEAR(cloud.part(PointCloud::kNormalY)[i], 0, 1e-5);
    EXPECT_NEAR(cloud.part(PointCloud::kNormalZ)[i], 0.70711, 1e-5);
  }
}

TEST(PointCloud, OfABallLiesOnTheBall) {
  Map map = ball_press(4, 0.8, 101, 0.05);
  PointCloud cloud;
  CloudMaker().make(map.grid, 1, cloud);
  double worst = 0;
  double worst_normal = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Vector point = vector_at(cloud, i, PointCloud::kX);
    // Its middle lies 4 − 0.8 mm above the surface; 0.3 mm from the contact's rim inwards.
    const Vector from{point[0], point[1], point[2] - 3.2e-3};
    if (std::hypot(point[0], point[1]) > 2.1e-3) continue;
    const double distance = std::hypot(from[0], from[1], from[2]);
    worst = std::max(worst, std::abs(distance - 4e-3));
    const Vector outward{-from[0] / distance, -from[1] / distance, -from[2] / distance};
    worst_normal =
        std::max(worst_normal, degrees_between(vector_at(cloud, i, PointCloud::kNormalX), outward));
  }
  EXPECT_LT(worst, 0.6e-6);  // half a unit, rounded
  EXPECT_LT(worst_normal, 0.4);
}

TEST(PointCloud, UntrustedPixelsAreHolesAndTheirNeighboursKeepANormal) {
  Map map = ball_press(4, 0.8, 61, 0.08);
  PointCloud whole;
  CloudMaker().make(map.grid, 1, whole);
  map.at(30, 34) = -32768;
  PointCloud cloud;
  CloudMaker().make(map.grid, 1, cloud);
  const std::size_t hole = 30 * 61 + 34;
  EXPECT_FALSE(cloud.has(hole));
  for (std::size_t part = 0; part < PointCloud::kParts; ++part) {
    EXPECT_TRUE(std::isnan(cloud.values[part * cloud.size() + hole]));
  }
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (i == hole) continue;
    ASSERT_TRUE(cloud.has(i));
    EXPECT_LT(degrees_between(vector_at(cloud, i, PointCloud::kNormalX),
                              vector_at(whole, i, PointCloud::kNormalX)),
              1.5)
        << i;
  }
}

TEST(PointCloud, APixelWithoutNeighboursIsLeftOut) {
  Map map(7, 7, 0.16);
  std::ranges::fill(map.values, std::int16_t{-32768});
  map.at(3, 3) = 100;
  PointCloud cloud;
  CloudMaker().make(map.grid, 1, cloud);
  for (std::size_t i = 0; i < cloud.size(); ++i) EXPECT_FALSE(cloud.has(i));
}

TEST(PointCloud, AStrideTakesTheSamePixelsOfEveryPart) {
  Map map = ball_press(4, 0.8, 101, 0.05);
  CloudMaker maker;
  PointCloud fine;
  PointCloud coarse;
  maker.make(map.grid, 1, fine);
  maker.make(map.grid, 4, coarse);
  // 101 = 25 · 4 + 1: blocks begin at 0, their third pixel is taken.
  EXPECT_EQ(coarse.width, 25);
  EXPECT_EQ(coarse.x, 2);
  EXPECT_EQ(coarse.part(PointCloud::kZ)[12 * 25 + 12], fine.part(PointCloud::kZ)[50 * 101 + 50]);
  Map part = map.cut(41, 39, 20, 21);
  PointCloud cut;
  maker.make(part.grid, 4, cut);
  EXPECT_EQ(cut.x, 42);
  EXPECT_EQ(cut.y, 42);
  EXPECT_EQ(cut.width, 5);
  EXPECT_EQ(cut.height, 5);
  // Metres, in the middle of the map: processors round these differently.
  EXPECT_NEAR(cut.part(PointCloud::kX)[12], fine.part(PointCloud::kX)[50 * 101 + 50], 1e-9);
  EXPECT_EQ(cut.part(PointCloud::kZ)[12], fine.part(PointCloud::kZ)[50 * 101 + 50]);
}

TEST(PointCloud, OnASphereDepthMovesPointsAlongTheRay) {
  Map map(81, 81, 0.1);
  std::ranges::fill(map.values, std::int16_t{500});
  // Pressed half a millimetre all over: a sphere of 11.5 mm about the same middle, to first order.
  PointCloud cloud;
  CloudMaker(recon::Surface{Kind::sphere, 12, 0, 20, 8, 1.41}).make(map.grid, 1, cloud);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    ASSERT_TRUE(cloud.has(i));
    const Vector point = vector_at(cloud, i, PointCloud::kX);
    const Vector out{point[0] / 11.5e-3, point[1] / 11.5e-3, (point[2] + 12e-3) / 11.5e-3};
    EXPECT_NEAR(std::hypot(out[0], out[1], out[2]), 1, 2e-4);
    EXPECT_LT(degrees_between(vector_at(cloud, i, PointCloud::kNormalX), out), 1.0);
  }
}

TEST(PointCloud, BesideACurvedSurfaceThereAreNoPoints) {
  Map map(41, 41, 0.5);
  PointCloud cloud;
  CloudMaker(recon::Surface{Kind::sphere, 5, 0, 20, 5, 1.41}).make(map.grid, 1, cloud);
  EXPECT_FALSE(cloud.has(0));
  EXPECT_TRUE(cloud.has(20 * 41 + 20));
}

TEST(PointCloud, TrianglesLookOutwardsAndLeaveHolesOpen) {
  Map map(5, 5, 0.16);
  PointCloud cloud;
  CloudMaker maker;
  maker.make(map.grid, 1, cloud);
  std::size_t triangles = 0;
  for_each_triangle(cloud, [&](std::size_t a, std::size_t b, std::size_t c) {
    const auto x = cloud.part(PointCloud::kX);
    const auto y = cloud.part(PointCloud::kY);
    EXPECT_GT((x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]), 0);
    ++triangles;
  });
  EXPECT_EQ(triangles, 32U);
  map.at(2, 2) = -32768;
  maker.make(map.grid, 1, cloud);
  triangles = 0;
  for_each_triangle(cloud, [&](auto...) { ++triangles; });
  EXPECT_EQ(triangles, 26U);
}

TEST(PointCloud, RefusesContradictingSizes) {
  Map map(4, 3, 0.1);
  PointCloud cloud;
  map.grid.full_width = 3;
  EXPECT_THROW(CloudMaker().make(map.grid, 1, cloud), std::invalid_argument);
  map.grid.full_width = 4;
  EXPECT_THROW(CloudMaker().make(map.grid, 0, cloud), std::invalid_argument);
}

TEST(PointCloud, RefusesEachSizeThatContradictsAnother) {
  // Columns 2 … 5 and rows 1 … 3, which are the last of the whole map.
  const auto refused = [](const std::function<void(DepthGrid&)>& change) {
    Map map(4, 3, 0.1);
    map.grid.x = 2;
    map.grid.y = 1;
    map.grid.full_width = 6;
    map.grid.full_height = 4;
    change(map.grid);
    PointCloud cloud;
    try {
      CloudMaker().make(map.grid, 1, cloud);
      return false;
    } catch (const std::invalid_argument&) {
      return true;
    }
  };
  EXPECT_FALSE(refused([](DepthGrid&) {}));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.x = 3; }));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.x = -1; }));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.y = 2; }));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.y = -1; }));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.full_width = 5; }));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.full_height = 3; }));
  EXPECT_TRUE(refused([](DepthGrid& grid) { grid.values = grid.values.first(11); }));
  for (const double scale : {0.0, -0.1, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_TRUE(refused([scale](DepthGrid& grid) { grid.mm_per_px = scale; })) << scale;
  }
  EXPECT_TRUE(refused([](DepthGrid& grid) {
    grid.width = 0;
    grid.values = {};
  }));
  EXPECT_TRUE(refused([](DepthGrid& grid) {
    grid.height = 0;
    grid.values = {};
  }));
}

// 103 = 25 · 4 + 3 and 54 = 13 · 4 + 2: the blocks of four begin at column 1 and row 1, and the
// third pixel of a block is taken.
TEST(PointCloud, AStrideLeavesBothSidesOutAlike) {
  Map map(103, 54, 0.05);
  for (int row = 0; row < 54; ++row) {
    for (int column = 0; column < 103; ++column) {
      map.at(row, column) = static_cast<std::int16_t>(103 * row + column);
    }
  }
  CloudMaker maker;
  PointCloud cloud;
  const auto expect_pixels = [&](int x, int y, int width, int height) {
    EXPECT_EQ(cloud.stride, 4);
    ASSERT_EQ(cloud.x, x);
    ASSERT_EQ(cloud.y, y);
    ASSERT_EQ(cloud.width, width);
    ASSERT_EQ(cloud.height, height);
    for (int i = 0; i < height; ++i) {
      for (int k = 0; k < width; ++k) {
        const auto at = static_cast<std::size_t>(i * width + k);
        ASSERT_NEAR(cloud.part(PointCloud::kZ)[at], -1e-6 * (103 * (y + 4 * i) + x + 4 * k), 1e-9);
      }
    }
  };
  maker.make(map.grid, 4, cloud);
  expect_pixels(3, 3, 25, 13);
  const Map beside = map.cut(5, 6, 30, 20);  // columns to 34 and rows to 25
  maker.make(beside.grid, 4, cloud);
  expect_pixels(7, 7, 7, 5);
  const Map between = map.cut(4, 4, 3, 3);
  maker.make(between.grid, 4, cloud);
  expect_pixels(7, 7, 0, 0);
}

}  // namespace
}  // namespace dtact::perceive
