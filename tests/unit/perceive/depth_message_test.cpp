#include "clients/common/depth_message.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "clients/cpp/errors.hpp"

namespace dtact::cli {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;
using Kind = recon::Surface::Kind;

v1::Surface sphere() {
  v1::Surface surface;
  surface.set_shape(v1::Surface::SPHERE);
  surface.set_radius_mm(10);
  surface.set_air_mm(20);
  surface.set_gel_mm(5);
  surface.set_refraction(1.41);
  return surface;
}

void expect_refused(const v1::Surface& surface, const std::string& what) {
  EXPECT_THAT([&] { (void)surface_of(surface); },
              ThrowsMessage<client::ProtocolError>(HasSubstr(what)));
}

TEST(SurfaceOf, ReadsEachShape) {
  EXPECT_EQ(surface_of({}), recon::Surface{});
  EXPECT_EQ(surface_of(sphere()), (recon::Surface{Kind::sphere, 10, 0, 20, 5, 1.41}));
  v1::Surface cylinder = sphere();
  cylinder.set_shape(v1::Surface::CYLINDER);
  cylinder.set_axis_deg(-30);
  EXPECT_EQ(surface_of(cylinder), (recon::Surface{Kind::cylinder, 10, -30, 20, 5, 1.41}));
}

TEST(SurfaceOf, RefusesWhatContradictsItself) {
  v1::Surface surface = sphere();
  surface.set_shape(static_cast<v1::Surface::Shape>(9));
  expect_refused(surface, "a shape, 9,");
  surface = sphere();
  surface.set_radius_mm(0);
  expect_refused(surface, "0 mm radius");
  surface = sphere();
  surface.set_gel_mm(std::numeric_limits<double>::quiet_NaN());
  expect_refused(surface, "nan mm of gel");
  surface = sphere();
  surface.set_refraction(0.9);
  expect_refused(surface, "index 0.9");
}

/// A map of 3 × 2 pixels of a millimetre of one that has 9 × 8.
v1::Frame frame_of(const v1::Surface& surface) {
  v1::Frame frame;
  *frame.mutable_surface() = surface;
  v1::DepthMap& map = *frame.mutable_depth();
  map.set_x(5);
  map.set_y(4);
  map.set_width(3);
  map.set_height(2);
  map.set_full_width(9);
  map.set_full_height(8);
  map.set_mm_per_px(1);
  map.set_um_per_unit(1);
  return frame;
}

TEST(DepthImage, ItsPointsLieOnTheSurfaceWhereTheMapIs) {
  const std::vector<float> mm(6, 0);
  const auto first_point = [&](const v1::Surface& surface) {
    const std::string pcd = encoder_for("a.pcd", nullptr)(depth_image(frame_of(surface), mm));
    std::array<float, 3> point{};
    const std::size_t data = pcd.find("DATA binary\n") + std::strlen("DATA binary\n");
    std::memcpy(point.data(), pcd.data() + data, sizeof point);
    return point;
  };
  // (5 − 4, 4 − 3.5) mm from the middle.
  const auto flat = first_point({});
  EXPECT_FLOAT_EQ(flat[0], 1e-3F);
  EXPECT_FLOAT_EQ(flat[1], 0.5e-3F);
  EXPECT_EQ(flat[2], 0);
  EXPECT_NEAR(first_point(sphere())[2], -0.0626e-3, 0.002e-3) << "1.12² / (2 · 10) mm";
}

TEST(DepthImage, RefusesAMapBesideItsWhole) {
  v1::Frame frame = frame_of({});
  frame.mutable_depth()->set_x(7);
  EXPECT_THROW((void)depth_image(frame, {}), client::ProtocolError);
}

// Before: an export as a point cloud looked for a pixel's neighbours over 10⁸ pixels.
TEST(DepthImage, RefusesAScaleThatNoCalibrationHas) {
  for (const double mm_per_px : {1e-9, 0.0, 1e9, std::numeric_limits<double>::quiet_NaN()}) {
    v1::Frame frame = frame_of({});
    frame.mutable_depth()->set_mm_per_px(mm_per_px);
    EXPECT_THAT([&] { (void)depth_image(frame, {}); },
                ThrowsMessage<client::ProtocolError>(HasSubstr("mm a pixel")));
  }
}

}  // namespace
}  // namespace dtact::cli
