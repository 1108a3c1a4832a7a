#include "daemon/recon/surface.hpp"

#include <gtest/gtest.h>

namespace dtact::recon {
namespace {

// Half a millimetre under a camera 25 mm high is a fiftieth of the height.
TEST(Viewpoint, PlacesAPointNearerToTheFootByItsShareOfTheHeight) {
  const Viewpoint view{.foot_mm = {1, -2}, .per_mm = 0.04};
  const Point place = view.place({6, 8}, 0.5);
  EXPECT_NEAR(place.x, 5.9, 1e-12);  // 6 − (6 − 1)/50
  EXPECT_NEAR(place.y, 7.8, 1e-12);  // 8 − (8 + 2)/50
}

TEST(Viewpoint, SeesAPointFartherFromTheFoot) {
  const Viewpoint view{.foot_mm = {1, -2}, .per_mm = 0.04};
  const Point seen = view.seen({5.9, 7.8}, 0.5);
  EXPECT_NEAR(seen.x, 6, 1e-12);  // 1 + 4.9/0.98
  EXPECT_NEAR(seen.y, 8, 1e-12);  // −2 + 9.8/0.98
}

TEST(Viewpoint, OfUnknownHeightMovesNothing) {
  const Viewpoint view;
  EXPECT_EQ(view.place({6, 8}, 0.5), (Point{6, 8}));
  EXPECT_EQ(view.seen({6, 8}, 0.5), (Point{6, 8}));
}

TEST(Viewpoint, WithoutAFootIsAboveTheOrigin) {
  const Viewpoint view{.foot_mm = {}, .per_mm = 0.04};
  const Point place = view.place({6, 8}, 0.5);
  EXPECT_NEAR(place.x, 5.88, 1e-12);
  EXPECT_NEAR(place.y, 7.84, 1e-12);
}

// What a calibration without [surface] and a message without a surface mean.
TEST(Surface, IsAPlaneUnlessSomethingElseIsStated) {
  const Surface surface;
  EXPECT_EQ(surface.kind, Surface::Kind::plane);
  EXPECT_EQ(surface.radius_mm, 0);
  EXPECT_EQ(surface.axis_deg, 0);
  EXPECT_EQ(surface.air_mm, 0);
  EXPECT_EQ(surface.gel_mm, 0);
  EXPECT_EQ(surface.refraction, 1) << "the air's";
  EXPECT_EQ(surface.view.foot_mm.x, 0);
  EXPECT_EQ(surface.view.foot_mm.y, 0);
  EXPECT_EQ(surface.view.per_mm, 0);
}

}  // namespace
}  // namespace dtact::recon
