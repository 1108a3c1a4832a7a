// Known objects made of balls: their samples, the poses that search() finds, and their tracking.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "clients/perceive/pose/object_tracker.hpp"
#include "tests/unit/perceive/balls.hpp"

namespace dtact::perceive {
namespace {

using namespace test;
using Eigen::Vector3d;
using State = Tracker::State;

Mesh box(double x, double y, double z) {
  Mesh mesh;
  for (unsigned i = 0; i < 8; ++i) {
    mesh.points.push_back({(i & 1U) != 0 ? x : 0, (i & 2U) != 0 ? y : 0, (i & 4U) != 0 ? z : 0});
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

std::string message_of(const Mesh& mesh, double metres) {
  try {
    (void)make_object(mesh, metres, "object");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "none";
}

Error off(const Tracker::Pose& pose, const Motion& truth) {
  return error_of(pose.alignment, truth);
}

/// A placement as the pose of the contact in which it was found.
Alignment alignment_of(const Placement& found, const ContactPatch& patch) {
  Alignment alignment;
  alignment.motion = found.pose;
  alignment.covariance = found.covariance;
  alignment.centre = patch.frame * patch.middle;
  alignment.arm = patch.arm;
  return alignment;
}

std::size_t unobservable(const Alignment& found) {
  return perceive::unobservable_of(found.covariance, found.centre, found.arm).size();
}

TEST(ObjectModel, ABoxIsSampledEvenlyAndRestsOnSixFaces) {
  const ObjectModel model = make_object(box(4, 5, 6), 1e-3, "box");
  // 148 mm² at 0.15 mm.
  EXPECT_GT(model.surfels.size(), 5000U);
  EXPECT_LT(model.surfels.size(), 9000U);
  EXPECT_EQ(model.rests.size(), 6U);
  std::array<int, 3> by_axis{};
  for (const Surfel& surfel : model.surfels) {
    Eigen::Index axis = 0;
    EXPECT_NEAR(surfel.normal.cwiseAbs().maxCoeff(&axis), 1, 1e-12);
    ++by_axis.at(static_cast<std::size_t>(axis));
    // The normal points into the object.
    EXPECT_GT(surfel.normal.dot(Vector3d(0.002, 0.0025, 0.003) - surfel.point), 0);
  }
  // Faces of 30, 24 and 20 mm².
  EXPECT_NEAR(by_axis[0] / 30.0 / by_axis[2] * 20, 1, 0.15);
  EXPECT_NEAR(by_axis[1] / 24.0 / by_axis[2] * 20, 1, 0.15);
}

TEST(ObjectModel, LargeOnesAreSampledLess) {
  const ObjectModel model = make_object(box(100, 100, 20), 1e-3, "box");
  EXPECT_LE(model.surfels.size(), kMaxSurfels);
  EXPECT_GT(model.surfels.size(), kMaxSurfels / 3);
}

TEST(ObjectModel, AWrongUnitAndAnInsideOutShapeAreReported) {
  EXPECT_THAT(message_of(box(4, 5, 6), 1), testing::HasSubstr("is its unit another one?"));
  EXPECT_THAT(message_of(box(0.004, 0.005, 0.006), 1e-3), testing::HasSubstr("unit"));
  Mesh turned = box(4, 5, 6);
  for (auto& triangle : turned.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_THAT(message_of(turned, 1e-3), testing::HasSubstr("looks inwards"));
  Mesh flat = box(4, 5, 6);
  flat.triangles = {{0, 0, 1}};
  EXPECT_THAT(message_of(flat, 1e-3), testing::HasSubstr("50 are needed"));
}

TEST(ObjectModel, ASparseCloudIsRefused) {
  const Balls ball{{{{0, 0, 3.0}, 4.0}}};
  // The points share 201 mm².
  EXPECT_THAT(message_of(cloud_of(ball, 4000), 1e-3),
              testing::HasSubstr("at most 0.15 mm is needed"));
  EXPECT_EQ(message_of(cloud_of(ball, 12000), 1e-3), "none");
}

TEST(ContactPatch, IsAsLargeBesideEveryEdge) {
  const Balls ball{{{{0, 0, 1.1}, 1.5}}};
  const double area = make_patch(Frame(ball, Motion::Identity()).view()).area;
  EXPECT_GT(area, 0);
  for (const Vector3d& mm :
       {Vector3d(3.1, 0, 0), Vector3d(-3.1, 0, 0), Vector3d(0, 2.7, 0), Vector3d(0, -2.7, 0)}) {
    EXPECT_NEAR(make_patch(Frame(ball, moved(mm)).view()).area, area, 0.02 * area)
        << mm.transpose();
  }
}

TEST(SearchPlacement, FindsBumpsWhereverTheyAre) {
  const auto model = model_of(bumps());
  std::vector<recon::Surface> surfaces = curved();
  surfaces.insert(surfaces.begin(), recon::Surface{});
  for (const recon::Surface& surface : surfaces) {
    for (const Motion& truth :
         {moved({0.3, -0.2, 0}, Vector3d::UnitZ(), 100), moved({0, 0, 0}, {0.03, -0.02, 1}, -40)}) {
      SCOPED_TRACE(testing::Message()
                   << "radius " << surface.radius_mm << ", at " << truth.translation().transpose());
      const Frame frame(bumps(), truth, 5, 1, surface);
      const ContactPatch patch = make_patch(frame.view());
      const auto found = search(*model, patch);
      ASSERT_TRUE(found.has_value());
      EXPECT_EQ(found->alternatives, 0U);
      const Alignment placed = alignment_of(*found, patch);
      EXPECT_EQ(unobservable(placed), 0U);
      EXPECT_LT(error_of(placed, truth).um, 60);
      EXPECT_LT(error_of(placed, truth).degrees, 3);
    }
  }
}

TEST(SearchPlacement, ABallIsFoundOnceAndItsTurnsAreHidden) {
  const Balls ball{{{{0, 0, 3.0}, 4.0}}};
  const Frame frame(ball, moved({0.5, 0.2, 0}), 5);
  const ContactPatch patch = make_patch(frame.view());
  const auto found = search(*model_of(ball), patch);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(unobservable(alignment_of(*found, patch)), 3U);
  EXPECT_EQ(found->alternatives, 0U);
  EXPECT_LT((found->pose * Vector3d(0, 0, 0.003) - Vector3d(0.0005, 0.0002, 0.003)).norm(), 3e-5);
}

TEST(SearchPlacement, AnotherObjectIsNotFound) {
  const Frame frame({{{{0, 0, 3.0}, 4.0}}}, Motion::Identity(), 5);
  EXPECT_FALSE(search(*model_of(bumps()), make_patch(frame.view())).has_value());
  const Frame nothing({}, Motion::Identity());
  EXPECT_FALSE(search(*model_of(bumps()), make_patch(nothing.view())).has_value());
}

TEST(ObjectTracker, SearchesFindsAndFollowsWithoutWaiting) {
  ObjectTracker tracker(model_of(bumps()));
  Frame frame(bumps(), moved({0, 0, 0}, Vector3d::UnitZ(), 60), 5);
  EXPECT_EQ(tracker.follow(frame.view(), 10).state, State::searching);
  EXPECT_TRUE(tracker.is_searching());
  // The object moves on during the search.
  const Motion next = moved({0.1, 0, 0}, Vector3d::UnitZ(), 62);
  const Frame second(bumps(), next, 5, 2);
  (void)tracker.follow(second.view(), 11);
  tracker.wait();
  (void)tracker.follow(second.view(), 12);
  EXPECT_GE(tracker.pose().since, 11U);
  EXPECT_LT(off(tracker.pose(), next).um, 40);
  for (unsigned i = 0; i < 20; ++i) {
    const Motion truth = moved({0.1 + 0.05 * i, 0, 0}, Vector3d::UnitZ(), 62 + i);
    const Frame later(bumps(), truth, 5, 3 + i);
    EXPECT_EQ(tracker.follow(later.view(), 13 + i).state, State::tracked);
    EXPECT_LT(off(tracker.pose(), truth).um, 40);
    EXPECT_LT(off(tracker.pose(), truth).degrees, 0.8);
  }
}

TEST(ObjectTracker, ALossIsReportedAndEndsWithASearch) {
  const auto model = model_of(bumps());
  ObjectTracker tracker(model);
  const Frame frame(bumps(), Motion::Identity(), 5);
  (void)tracker.follow(frame.view(), 1);
  tracker.wait();
  EXPECT_EQ(tracker.follow(frame.view(), 2).state, State::started);
  const Motion away = moved({0.5, 1.2, 0}, Vector3d::UnitZ(), 90);
  const Frame jumped(bumps(), away, 5);
  EXPECT_EQ(tracker.follow(jumped.view(), 3).state, State::lost);
  tracker.wait();
  EXPECT_EQ(tracker.follow(jumped.view(), 4).state, State::recovered);
  EXPECT_LT(off(tracker.pose(), away).um, 40);
  EXPECT_EQ(tracker.follow(jumped.view(), 5).state, State::tracked);
}

// A ball in contact says nothing of the larger one above it, until that one is in contact where the
// placement does not have it.
TEST(ObjectTracker, APlacementThatTheContactContradictsIsReported) {
  const Vector3d small(0, 0, 1.2);
  const Vector3d large(2.4, 0, 1.9);
  const Balls object{{{small, 1.5}, {large, 2.2}}};
  const auto turned = [&](const Vector3d& axis, double degrees) {
    return moved(small) * moved({0, 0, 0}, axis, degrees) * moved(-small);
  };
  ObjectTracker tracker(model_of(object));
  const Frame first(object, turned(Vector3d::UnitY(), -40), 2);
  (void)tracker.follow(first.view(), 1);
  tracker.wait();
  ASSERT_EQ(tracker.follow(first.view(), 2).state, State::started);
  const Vector3d beside = tracker.pose().alignment.motion.linear() * (large - small);
  const double opposite = 180 + std::atan2(beside.y(), beside.x()) * 180 / M_PI;
  const Motion truth = turned(Vector3d::UnitZ(), opposite);
  const Frame second(object, truth, 2, 2);
  EXPECT_EQ(tracker.follow(second.view(), 3).state, State::tracked);
  ASSERT_TRUE(tracker.is_searching());
  tracker.wait();
  EXPECT_EQ(tracker.follow(second.view(), 4).state, State::recovered);
  const Vector3d there = tracker.pose().alignment.motion * (1e-3 * large);
  EXPECT_LT((there - truth * (1e-3 * large)).norm(), 3e-4);
  EXPECT_EQ(tracker.follow(second.view(), 5).state, State::tracked);
}

TEST(SearchPlacement, SaysWhetherItKeepsThePoseSoFar) {
  const Motion truth = moved({0.3, -0.2, 0}, Vector3d::UnitZ(), 100);
  const Frame frame(bumps(), truth, 5);
  const ContactPatch patch = make_patch(frame.view());
  const auto model = model_of(bumps());
  const auto kept = search(*model, patch, truth);
  ASSERT_TRUE(kept.has_value());
  EXPECT_TRUE(kept->kept);
  const auto replaced = search(*model, patch, truth * moved({0, 0, 0}, Vector3d::UnitZ(), 90));
  ASSERT_TRUE(replaced.has_value());
  EXPECT_FALSE(replaced->kept);
}

TEST(ObjectTracker, AnotherContactBeginsWithASearch) {
  ObjectTracker tracker(model_of(bumps()));
  const Frame frame(bumps(), Motion::Identity(), 5);
  (void)tracker.follow(frame.view(), 1);
  tracker.release();
  EXPECT_EQ(tracker.pose().state, State::idle);
  tracker.wait();
  // The result of the search belongs to the contact before.
  EXPECT_EQ(tracker.follow(frame.view(), 2).state, State::searching);
  tracker.wait();
  EXPECT_EQ(tracker.follow(frame.view(), 3).state, State::started);
}

// Files of large assemblies have this: a first correction by a degree is 1.7 mm there.
TEST(ObjectTracker, TheFilesOriginMayLieFarFromTheContact) {
  const Vector3d far(100, 0, 0);
  Balls object = bumps();
  for (auto& ball : object.balls) ball.middle += far;
  ObjectTracker tracker(model_of(object));
  const Motion truth = moved({0, 0, 0}, Vector3d::UnitZ(), 60) * moved(-far);
  const Frame frame(object, truth, 5);
  (void)tracker.follow(frame.view(), 1);
  tracker.wait();
  EXPECT_EQ(tracker.follow(frame.view(), 2).state, State::started);
  for (unsigned i = 1; i <= 10; ++i) {
    const Motion next = moved({0, 0, 0}, Vector3d::UnitZ(), 60 + i) * moved(-far);
    const Frame later(object, next, 5, i);
    EXPECT_EQ(tracker.follow(later.view(), 2 + i).state, State::tracked) << i;
    EXPECT_LT(off(tracker.pose(), next).um, 40);
  }
}

// A ball with a bump rolls until the bump has left the contact. Its rotation from there on is
// visible neither on the ball nor in the contact's motion.
TEST(ObjectTracker, WhatNobodyFollowsIsReported) {
  const Balls object{{{{0, 0, 3.2}, 4.0}, {{2.2, 0, 1.1}, 1.5}}};
  ObjectTracker tracker(model_of(object));
  const Vector3d middle(0, 0, 3.2);
  const auto rolled = [&](double degrees) {
    return moved(middle) * moved({0, 0, 0}, Vector3d::UnitY(), degrees) * moved(-middle);
  };
  const Frame first(object, rolled(0), 2);
  (void)tracker.follow(first.view(), 1);
  tracker.wait();
  EXPECT_EQ(tracker.follow(first.view(), 2).state, State::started);
  // The rotation about the line between the middles.
  EXPECT_EQ(tracker.pose().unobservable.size(), 1U);
  for (unsigned i = 1; i <= 20; ++i) {
    const Frame frame(object, rolled(-1.0 * i), 2, i);
    EXPECT_EQ(tracker.follow(frame.view(), 2 + i).state, State::tracked) << i;
    tracker.wait();
  }
  const std::vector<Twist>& unknown = tracker.pose().unobservable;
  ASSERT_GE(unknown.size(), 2U);
  // Rotations about the ball's middle: its points do not move along the normal.
  for (const Twist& one : unknown) EXPECT_GT(one.head<3>().norm(), 0.3);
}

/// A box's lower face of `x` × `y` mm about `middle`, pressed 0.4 mm in along the axes; the gel
/// falls off beside it.
Frame pressed_face(double x, double y, const Vector3d& middle, unsigned seed) {
  return Frame(
      [&](const SurfacePoint& at) {
        const Vector3d from = 1e3 * Vector3d(at.point.data()) - middle;
        const double beside = std::hypot(std::max(0.0, std::abs(from.x()) - x / 2),
                                         std::max(0.0, std::abs(from.y()) - y / 2));
        return 0.4 * std::exp(-beside / 0.15);
      },
      2, seed);
}

// A third of the face overlaps its old position, and a flat face fits any flat place.
TEST(ObjectTracker, AFaceThatJumpsAlongItselfIsLostAndFound) {
  // A flat face is found by its outline, which the gel rounds: found means within 0.5 mm.
  constexpr double kFaceUm = 500;
  ObjectTracker tracker(
      std::make_shared<const ObjectModel>(make_object(box(4, 3, 2), 1e-3, "box")));
  const Vector3d middle(-0.8, -0.6, 0);
  const auto off_um = [&](const Vector3d& truth_mm) {
    // Its lower side is 0.4 mm in, the middle of the box 1 mm above.
    const Vector3d found = tracker.pose().alignment.motion * Vector3d(2e-3, 1.5e-3, 1e-3);
    return 1e6 * (found - 1e-3 * (truth_mm + Vector3d(0, 0, 0.6))).norm();
  };
  const Frame first = pressed_face(4, 3, middle, 1);
  (void)tracker.follow(first.view(), 1);
  tracker.wait();
  ASSERT_EQ(tracker.follow(first.view(), 2).state, State::started);
  EXPECT_TRUE(tracker.pose().unobservable.empty()) << "its outline was seen";
  EXPECT_LT(off_um(middle), kFaceUm);

  const Vector3d there = middle + Vector3d(2, 1.2, 0);
  const Frame jumped = pressed_face(4, 3, there, 2);
  EXPECT_EQ(tracker.follow(jumped.view(), 3).state, State::lost);
  EXPECT_TRUE(tracker.is_searching());
  EXPECT_EQ(tracker.follow(jumped.view(), 4).state, State::lost) << "until it is found";
  tracker.wait();
  EXPECT_EQ(tracker.follow(jumped.view(), 5).state, State::recovered);
  EXPECT_LT(off_um(there), kFaceUm);
  EXPECT_EQ(tracker.follow(jumped.view(), 6).state, State::tracked);
}

TEST(ObjectTracker, WhatIsNotFoundIsSearchedForEverMoreSeldom) {
  ObjectTracker tracker(model_of(bumps()));
  const Frame another({{{{0, 0, 3.0}, 4.0}}}, Motion::Identity(), 5);
  const ContactView view = another.view();
  int searches = 0;
  for (unsigned i = 0; i < 600; ++i) {
    EXPECT_EQ(tracker.follow(view, i).state, State::searching);
    if (!tracker.is_searching()) continue;
    ++searches;
    tracker.wait();
  }
  // The first search is at once, the next 30, 60, 120 and 240 frames after the one before.
  EXPECT_EQ(searches, 5);
}

TEST(ObjectTracker, WhatIsPressedDeeperIsSearchedForAtOnce) {
  ObjectTracker tracker(model_of(bumps()));
  const auto another = [](double depth_mm, unsigned seed) {
    return Frame({{{{0, 0, 4.0 - depth_mm}, 4.0}}}, Motion::Identity(), 5, seed);
  };
  const Frame light = another(0.7, 1);
  // Searches at 0, 30 and 90; the next without growth would be at 210.
  for (unsigned i = 0; i < 120; ++i) {
    (void)tracker.follow(light.view(), i);
    tracker.wait();
  }
  ASSERT_FALSE(tracker.is_searching());
  bool searched = false;
  // The area grows by six tenths.
  for (unsigned i = 0; i < 17; ++i) {
    const Frame deeper = another(0.73 + 0.03 * i, 2 + i);
    (void)tracker.follow(deeper.view(), 120 + i);
    searched |= tracker.is_searching();
  }
  EXPECT_TRUE(searched);
}

TEST(ObjectTracker, ASearchThatIsNoLongerWantedEndsWithNothing) {
  const Frame frame(bumps(), Motion::Identity(), 5);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(search(*model_of(bumps()), make_patch(frame.view()), {}, stop.get_token()));
}

}  // namespace
}  // namespace dtact::perceive
