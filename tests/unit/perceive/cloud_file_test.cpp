#include "clients/geometry/cloud_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace dtact::perceive {
namespace {

using testing::StartsWith;

/// Two rows of two: a hole, and three points in the plane.
PointCloud triangle() {
  PointCloud cloud;
  cloud.width = 2;
  cloud.height = 2;
  const float hole = std::numeric_limits<float>::quiet_NaN();
  cloud.values = {hole, 1, 0, 1, hole, 0, 1, 1, hole, 0, 0, 0,
                  hole, 0, 0, 0, hole, 0, 0, 0, hole, 1, 1, 1};
  return cloud;
}

TEST(CloudFile, PlyHasPointsNormalsAndTriangles) {
  const std::string ply = encode_ply(triangle());
  EXPECT_THAT(ply, StartsWith("ply\nformat binary_little_endian 1.0\ncomment metres; x right, y "
                              "down, z away from the camera; pressed is negative z\n"
                              "element vertex 3\nproperty float x\nproperty float y\n"
                              "property float z\nproperty float nx\nproperty float ny\n"
                              "property float nz\nelement face 1\n"
                              "property list uchar int vertex_indices\nend_header\n"));
  ASSERT_EQ(ply.size(), ply.find("end_header\n") + 11 + 3 * 24 + 13);
  // (1, 0, 0) with the normal (0, 0, 1).
  EXPECT_EQ(ply.substr(ply.size() - 85, 24),
            std::string("\0\0\x80\x3F\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x80\x3F", 24));
  EXPECT_EQ(ply.substr(ply.size() - 13), std::string("\3\0\0\0\0\2\0\0\0\1\0\0\0", 13));
}

TEST(CloudFile, PcdIsTheGrid) {
  const std::string pcd = encode_pcd(triangle());
  EXPECT_THAT(pcd, StartsWith("# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
                              "FIELDS x y z normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4\n"
                              "TYPE F F F F F F\nCOUNT 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 2\n"
                              "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA binary\n"));
  ASSERT_EQ(pcd.size(), pcd.find("DATA binary\n") + 12 + 4 * 24);
  EXPECT_EQ(pcd.substr(pcd.size() - 96, 4), std::string("\0\0\xC0\x7F", 4));
  EXPECT_EQ(pcd.substr(pcd.size() - 72, 12), std::string("\0\0\x80\x3F\0\0\0\0\0\0\0\0", 12));
}

}  // namespace
}  // namespace dtact::perceive
