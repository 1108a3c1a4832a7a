// The underside of an object and its score against a contact, on surfels placed by hand.
#include "clients/perceive/pose/placement.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

namespace dtact::perceive {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kCell = 1e-4;

/// A plate of 10 × 6 surfels whose corner is at (2, −1) mm, 0.5 mm above the origin; `raised_mm`
/// of a column and row: how much higher it is there, NaN for a hole.
ObjectModel plate(
    const std::function<double(int, int)>& raised_mm = [](int, int) { return 0.0; },
    int columns = 10, int rows = 6) {
  ObjectModel model;
  model.spacing = kCell;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const double raised = raised_mm(column, row);
      if (std::isnan(raised)) continue;
      Surfel surfel;
      surfel.point = {2e-3 + column * kCell, -1e-3 + row * kCell, 5e-4 + 1e-3 * raised};
      model.surfels.push_back(surfel);
    }
  }
  return model;
}

/// The underside's place of a column and row, `z_mm` above its lowest.
Vector3d place(double column, double row, double z_mm = 0) {
  return {2e-3 + column * kCell, -1e-3 + row * kCell, 1e-3 * z_mm};
}

TEST(BottomView, HasACellForEachSurfel) {
  const BottomView bottom(plate(), Matrix3d::Identity(), 1e-3);
  EXPECT_LT((bottom.from_object() * Vector3d(2e-3, -1e-3, 5e-4) - place(0, 0)).norm(), 1e-12);
  for (const auto& [column, row] : {std::pair(0, 0), {9, 0}, {0, 5}, {9, 5}, {4, 2}}) {
    const Surfel* surfel = bottom.at(place(column + 0.4, row - 0.4, 3));
    ASSERT_NE(surfel, nullptr) << column << ", " << row;
    EXPECT_LT((surfel->point - place(column, row)).norm(), 1e-12) << column << ", " << row;
  }
  for (const auto& [column, row] : {std::pair(-0.6, 2.0), {9.6, 2.0}, {4.0, -0.6}, {4.0, 5.6}}) {
    EXPECT_EQ(bottom.at(place(column, row)), nullptr) << column << ", " << row;
  }
}

TEST(BottomView, LooksAtATurnedObjectFromBelow) {
  // A quarter of a turn about z: (x, y) comes to (−y, x).
  Matrix3d quarter;
  quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  const BottomView bottom(plate(), quarter, 1e-3);
  EXPECT_NE(bottom.at({1e-3, 2.9e-3, 0}), nullptr) << "the plate's (2.9, −1) mm";
  EXPECT_EQ(bottom.at({0.4e-3, 2.9e-3, 0}), nullptr);
  EXPECT_NE(bottom.at({0.5e-3, 2e-3, 0}), nullptr);
  // From behind there are normals that point out of the underside only.
  Matrix3d over;
  over << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  const BottomView behind(plate(), over, 1e-3);
  EXPECT_EQ(behind.at({2.5e-3, 0.75e-3, 0}), nullptr);
  EXPECT_EQ(behind.below(1).area, 0);
}

TEST(BottomView, LeavesOutWallsAndWhatIsHigh) {
  ObjectModel object = plate([](int column, int) { return column < 7 ? 0 : 0.3; });
  for (Surfel& surfel : object.surfels) {
    if (surfel.point.y() > -0.55e-3) surfel.normal = Vector3d::UnitX();  // the last row
  }
  const BottomView all(object, Matrix3d::Identity(), 1e-3);
  EXPECT_NE(all.at(place(7, 2)), nullptr);
  EXPECT_EQ(all.at(place(2, 5)), nullptr) << "a wall";
  const BottomView low(object, Matrix3d::Identity(), 2e-4);
  EXPECT_NE(low.at(place(6, 2)), nullptr);
  EXPECT_EQ(low.at(place(7, 2)), nullptr) << "0.3 mm above the lowest";
}

TEST(BottomView, OfTwoSurfelsTheLowerCounts) {
  ObjectModel object = plate();
  Surfel above = object.surfels[13];
  above.point.z() += 2e-4;
  object.surfels.push_back(above);
  object.surfels.insert(object.surfels.begin(), above);
  const BottomView bottom(object, Matrix3d::Identity(), 1e-3);
  EXPECT_NEAR(bottom.at(place(3, 1))->point.z(), 0, 1e-12);
}

// A cell with five neighbours or more is a gap between samples.
TEST(BottomView, FillsGapsAndKeepsHoles) {
  const BottomView bottom(plate([](int column, int row) {
                            const bool hole = column >= 4 && column <= 6 && row >= 1 && row <= 3;
                            return hole || (column == 8 && row == 2) ? NAN : 0;
                          }),
                          Matrix3d::Identity(), 1e-3);
  EXPECT_NE(bottom.at(place(8, 2)), nullptr) << "a gap";
  for (const auto& [column, row] : {std::pair(4, 1), {6, 1}, {4, 3}}) {
    EXPECT_NE(bottom.at(place(column, row)), nullptr) << column << ", " << row;
  }
  for (const auto& [column, row] : {std::pair(5, 1), {4, 2}, {5, 2}, {5, 3}}) {
    EXPECT_EQ(bottom.at(place(column, row)), nullptr) << column << ", " << row;
  }
}

TEST(BottomView, TheMiddleAndAreaOfWhatIsLow) {
  const BottomView bottom(
      plate([](int column, int row) { return column < 4 && row < 2 ? 0 : 0.3; }),
      Matrix3d::Identity(), 1e-3);
  // Columns 0 to 3 and rows 0 and 1: eight cells of 0.01 mm².
  const BottomView::Low low = bottom.below(1e-4);
  EXPECT_NEAR(low.area, 8e-8, 1e-14);
  EXPECT_NEAR(low.middle.x(), 2.15e-3, 1e-9);
  EXPECT_NEAR(low.middle.y(), -0.95e-3, 1e-9);
  const BottomView::Low all = bottom.below(4e-4);
  EXPECT_NEAR(all.area, 60e-8, 1e-13);
  EXPECT_NEAR(all.middle.x(), 2.45e-3, 1e-9);
  EXPECT_NEAR(all.middle.y(), -0.75e-3, 1e-9);
  EXPECT_EQ(bottom.below(-1e-4).area, 0);
}

/// The score of one place of the core `z_mm` above the plate.
double score_at(double z_mm, const Vector3d& normal = Vector3d::UnitZ()) {
  const BottomView bottom(plate(), Matrix3d::Identity(), 1e-3);
  ContactPatch patch;
  patch.core.push_back({place(7, 1, z_mm), normal});
  return score_of(bottom, patch, Motion::Identity(), 1e-4);
}

// Of 1 − (distance / limit)², and 1.5 times what is inside by more than 0.03 mm, up to the limit.
TEST(Score, OfOnePlaceFallsWithItsDistance) {
  EXPECT_NEAR(score_at(0), 1, 1e-9);
  EXPECT_NEAR(score_at(-0.05), 0.75, 1e-9) << "below the object";
  EXPECT_NEAR(score_at(-0.12), 0, 1e-9);
  EXPECT_NEAR(score_at(0.02), 0.96, 1e-9) << "inside it, by as much as noise may be";
  EXPECT_NEAR(score_at(0.08), 0.36 - 1.5 * 0.5, 1e-9);
  EXPECT_NEAR(score_at(0.3), -1.5, 1e-9);
  EXPECT_NEAR(score_at(0, {0.6, 0, 0.8}), 1, 1e-9);
  EXPECT_NEAR(score_at(0, {0.8, 0, 0.6}), 0, 1e-9) << "it looks another way";
  EXPECT_NEAR(score_at(0.08, {0.8, 0, 0.6}), -1.5 * 0.5, 1e-9);
}

TEST(Score, IsTheMeanOfTheCoreLessWhatIsInsideBesideIt) {
  const BottomView bottom(plate(), Matrix3d::Identity(), 1e-3);
  ContactPatch patch;
  patch.beside_weight = 0.25;
  for (const double z_mm : {0.0, 0.0, -0.05}) {
    patch.core.push_back({place(7, 1, z_mm), Vector3d::UnitZ()});
  }
  patch.core.push_back({place(7, 7), Vector3d::UnitZ()});  // beside the object
  const Motion here = Motion::Identity();
  EXPECT_NEAR(score_of(bottom, patch, here, 1e-4), 2.75 / 4, 1e-9);
  patch.beside.push_back({place(1, 4, 0.08), Vector3d::UnitZ()});   // half of a place inside
  patch.beside.push_back({place(1, 7, 0.08), Vector3d::UnitZ()});   // beside the object
  patch.beside.push_back({place(1, 4, -0.08), Vector3d::UnitZ()});  // below it
  EXPECT_NEAR(score_of(bottom, patch, here, 1e-4), (2.75 - 1.5 * 0.25 * 0.5) / 4, 1e-9);
}

TEST(Score, IsThatOfTheContactAfterTheMotion) {
  const BottomView bottom(plate(), Matrix3d::Identity(), 1e-3);
  ContactPatch patch;
  patch.core.push_back({Vector3d(0, 3e-4, 0), Vector3d::UnitX()});
  // Turns x to z.
  Motion move = Motion::Identity();
  move.linear() << 0, 0, -1, 0, 1, 0, 1, 0, 0;
  move.translation() = place(7, -2);
  EXPECT_NEAR(score_of(bottom, patch, move, 1e-4), 1, 1e-9);
  move.translation() = place(7, 3);
  EXPECT_NEAR(score_of(bottom, patch, move, 1e-4), 0, 1e-9) << "row 6";
}

// The twist is the object's, about the patch's middle: seen from the object the contact goes back.
TEST(Twisted, TurnsAndShiftsAboutTheMiddle) {
  ContactPatch patch;
  patch.middle = {1e-3, 2e-3, 0};
  patch.arm = 4e-3;
  Motion move = Motion::Identity();
  move.translation() = Vector3d(5e-3, 0, 0);
  Twist shift;
  shift << 0, 0, 0, 1e-4, -2e-4, 3e-4;
  EXPECT_LT(
      (twisted(move, patch, shift) * Vector3d(1e-3, 1e-3, 0) - Vector3d(5.9e-3, 1.2e-3, -0.3e-3))
          .norm(),
      1e-12);
  // A quarter of a turn about z.
  Twist turn;
  turn << 0, 0, patch.arm * M_PI / 2, 0, 0, 0;
  const Motion turned = twisted(move, patch, turn);
  EXPECT_LT((turned * patch.middle - Vector3d(6e-3, 2e-3, 0)).norm(), 1e-12);
  EXPECT_LT((turned * Vector3d(2e-3, 2e-3, 0) - Vector3d(6e-3, 1e-3, 0)).norm(), 1e-12);
}

/// How much of a direction lies in the span of orthonormal `twists`.
double part_of(const std::vector<Twist>& twists, Eigen::Index axis) {
  double part = 0;
  for (const Twist& twist : twists) part += twist[axis] * twist[axis];
  return part;
}

// A plate of 3 × 6 mm whose long edges are seen, and whose short ones are not.
TEST(Unobservable, IsTheSlideAlongEdgesThatAreNotSeen) {
  const BottomView bottom(plate([](int, int) { return 0.0; }, 30, 60), Matrix3d::Identity(), 1e-3);
  ContactPatch patch;
  patch.middle = place(14.5, 29.5);
  for (int row = 15; row < 45; ++row) {
    for (int column = 0; column < 30; ++column) {
      patch.core.push_back({place(column, row), Vector3d::UnitZ()});
    }
  }
  double squares = 0;
  for (const auto& sample : patch.core) squares += (sample.point - patch.middle).squaredNorm();
  patch.arm = std::sqrt(squares / static_cast<double>(patch.core.size()));
  const auto found = unobservable_twists(bottom, patch, Motion::Identity());
  EXPECT_NEAR(part_of(found, 4), 1, 1e-3) << "along y";
  EXPECT_LT(part_of(found, 3), 0.01) << "along x an edge leaves the object";
  for (const Eigen::Index axis : {0, 1, 5}) EXPECT_LT(part_of(found, axis), 0.01) << axis;
}

}  // namespace
}  // namespace dtact::perceive
