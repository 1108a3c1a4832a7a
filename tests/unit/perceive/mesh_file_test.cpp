#include "clients/geometry/mesh_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <stdexcept>

#include "hal/base/atomic_file.hpp"

namespace dtact::perceive {
namespace {

using testing::HasSubstr;

std::string seed(const std::string& name) {
  return base::read_file(DTACT_SOURCE_DIR "/tests/fuzz/corpus/mesh/" + name);
}

std::string error_of(const std::string& bytes) {
  try {
    (void)parse_mesh(bytes, "object");
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "none";
}

/// Six times the enclosed volume, from outward triangles.
double volume_of(const Mesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles) {
    const auto& a = mesh.points[t[0]];
    const auto& b = mesh.points[t[1]];
    const auto& c = mesh.points[t[2]];
    sum += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
           a[2] * (b[0] * c[1] - b[1] * c[0]);
  }
  return sum / 6;
}

std::string with(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(MeshFile, ACubeOfFourMillimetresInEveryFormat) {
  for (const char* name : {"ascii.stl", "binary.stl", "ascii.ply", "little.ply", "big.ply"}) {
    const Mesh mesh = parse_mesh(seed(name), name);
    EXPECT_EQ(mesh.triangles.size(), 12U) << name;
    EXPECT_DOUBLE_EQ(volume_of(mesh), 64) << name;
  }
}

TEST(MeshFile, ACloudHasNormals) {
  const Mesh mesh = parse_mesh(seed("cloud.ply"), "cloud");
  EXPECT_TRUE(mesh.triangles.empty());
  ASSERT_EQ(mesh.points.size(), 400U);
  ASSERT_EQ(mesh.normals.size(), 400U);
  EXPECT_NEAR(mesh.points[7][1], 2 * mesh.normals[7][1], 1e-6);
}

TEST(MeshFile, FurtherPropertiesAndElementsArePassedOver) {
  std::string text = seed("ascii.ply");
  text = with(text, "property float x\n",
              "property uchar red\nproperty list uchar int extra\nproperty float x\n");
  text = with(text, "end_header\n0 0 0\n4 0 0\n", "end_header\n9 2 7 7 0 0 0\n9 0 4 0 0\n");
  for (const char* rest : {"0 4 0\n", "4 4 0\n", "0 0 4\n", "4 0 4\n", "0 4 4\n", "4 4 4\n"}) {
    text = with(text, std::string("\n") + rest, std::string("\n9 0 ") + rest);
  }
  EXPECT_DOUBLE_EQ(volume_of(parse_mesh(text, "object")), 64);
}

/// The corners show which solid was left out; its triangles alone would not.
TEST(MeshFile, AllSolidsOfATextStlAreRead) {
  const auto solid = [](const std::string& name, const std::string& corner) {
    return "solid " + name + "\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex " +
           corner + "\n   vertex 0 7 0\n  endloop\n endfacet\nendsolid " + name + "\n";
  };
  const Mesh mesh =
      parse_mesh(solid("a part", "1 0 0") + "\n" + solid("", "2 0 0") + solid("b", "3 0 0"), "x");
  ASSERT_EQ(mesh.triangles.size(), 3U);
  EXPECT_EQ(mesh.points.at(1)[0], 1);
  EXPECT_EQ(mesh.points.at(4)[0], 2);
  EXPECT_EQ(mesh.points.at(7)[0], 3);
  EXPECT_THAT(error_of(solid("a", "1 0 0") + solid("b", "2 0 0").substr(0, 40)),
              HasSubstr("object, line 12: "));
  EXPECT_THAT(error_of(solid("a", "1 0 0") + "facet"),
              HasSubstr("line 10: after \"endsolid\" expected another \"solid\" or the file's end, "
                        "not \"facet\""));
}

TEST(MeshFile, WhatFollowsTheLastPartIsReported) {
  const std::string binary = seed("binary.stl");
  EXPECT_THAT(error_of(binary + "x"), HasSubstr("followed by 1 byte(s) too many"));
  EXPECT_THAT(error_of(binary + "x"), testing::Not(HasSubstr("cut off")));
  std::string named = binary;
  named.replace(0, 9, "solid box");
  EXPECT_THAT(error_of(named + "xyz"), HasSubstr("followed by 3 byte(s) too many"));
  EXPECT_THAT(error_of(named.substr(0, 600)), HasSubstr("cut off"));
  EXPECT_THAT(error_of(seed("little.ply") + "ab"),
              HasSubstr("2 byte(s) are left after the last element"));
  EXPECT_EQ(error_of(seed("ascii.ply") + " \n\n"), "none");
  EXPECT_THAT(error_of(with(seed("ascii.ply"), "element face 6", "element face 5")),
              HasSubstr("more follows after the last element"));
}

TEST(MeshFile, BrokenFilesAreReportedByPlaceAndFix) {
  const std::string stl = seed("ascii.stl");
  const std::string ply = seed("ascii.ply");
  EXPECT_THAT(error_of(""), HasSubstr("object, line 1: neither PLY nor STL"));
  EXPECT_THAT(error_of(std::string(200, 'x')), HasSubstr("object, byte 84: neither PLY nor STL"));
  EXPECT_THAT(error_of(with(stl, "vertex 0 4 0", "vertex 0 four 0")),
              HasSubstr("object, line 5: expected a number, not \"four\""));
  EXPECT_THAT(error_of(with(stl, "endloop", "end")),
              HasSubstr("expected \"endloop\", not \"end\""));
  EXPECT_THAT(error_of(stl.substr(0, 60)), HasSubstr("cut off"));
  EXPECT_THAT(error_of(seed("binary.stl").substr(0, 600)), HasSubstr("684 bytes, there are 600"));
  EXPECT_THAT(error_of(with(ply, "ascii", "text")),
              HasSubstr("object, line 2: expected the format"));
  EXPECT_THAT(error_of(with(ply, "float x", "real x")), HasSubstr("expected a type of PLY"));
  EXPECT_THAT(error_of(with(ply, "property float z\n", "")), HasSubstr("lack x, y or z"));
  EXPECT_THAT(error_of(with(ply, "element vertex 8", "element vertex 800000")),
              HasSubstr("ends before its vertices"));
  EXPECT_THAT(error_of(with(ply, "4 0 2 3 1", "4 0 2 3 9")),
              HasSubstr("a face names point 9, of 8"));
  EXPECT_THAT(error_of(with(ply, "4 0 2 3 1", "4 0 2 3 -1")), HasSubstr("a face's corner"));
  EXPECT_THAT(error_of(seed("little.ply").substr(0, 320)), HasSubstr("byte 3"));
  EXPECT_THAT(error_of(with(ply, "0 0 0\n4", "0 0 nan\n4")), HasSubstr("not a finite number"));
  const std::string points =
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n1 2 3\n";
  EXPECT_THAT(error_of(points), HasSubstr("neither faces nor normals"));
  EXPECT_THAT(error_of(seed("two_clouds.ply")), HasSubstr("line 7: a second element \"vertex\""));
  EXPECT_THAT(error_of("solid x\nendsolid x\n"), HasSubstr("no points"));
  EXPECT_THAT(error_of(std::string(kMaxMeshBytes + 1, ' ')), HasSubstr("larger than 64 MiB"));
}

TEST(MeshFile, PointsOfTextHaveANormalOfThreeFiniteNumbers) {
  const auto with_normal = [](const std::string& properties, const std::string& values) {
    return "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
           "property float z\n" +
           properties + "end_header\n+1.5 -2 3 " + values + "\n";
  };
  const std::string two = "property float nx\nproperty float ny\n";
  const std::string three = two + "property float nz\n";
  const Mesh mesh = parse_mesh(with_normal(three, "0 +0.6 0.8"), "object");
  ASSERT_EQ(mesh.points.size(), 1U);
  ASSERT_EQ(mesh.normals.size(), 1U);
  EXPECT_THAT(mesh.points[0], testing::ElementsAre(1.5, -2, 3));
  EXPECT_THAT(mesh.normals[0], testing::ElementsAre(0, 0.6, 0.8));
  EXPECT_THAT(error_of(with_normal(three, "0 nan 1")),
              HasSubstr("a normal is not a finite number"));
  EXPECT_THAT(error_of(with_normal(two, "0 1")), HasSubstr("neither faces nor normals"));
}

}  // namespace
}  // namespace dtact::perceive
