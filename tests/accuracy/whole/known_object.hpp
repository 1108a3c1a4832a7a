#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "hal/sim/objects.hpp"

namespace dtact::whole {

/// A simulated object as a file describes it: points with outward normals in its own frame, mm.
struct ObjectCloud {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;
};
/// Its underside, its upper side where it has one, and walls of 1.5 mm where it ends or steps.
[[nodiscard]] ObjectCloud cloud_of(const hal::sim::Object& object);
/// The same as a PLY file.
[[nodiscard]] std::string ply_of(const ObjectCloud& cloud);
/// A cube that stands on the origin as an ASCII STL file.
[[nodiscard]] std::string cube_stl(double side_mm);
/// The 24 turns after which that cube lies where it did.
[[nodiscard]] std::vector<Eigen::Isometry3d> cube_symmetries(double side_mm);

/// The turns about the object's z, in steps of 10, 15 and 72°, with or without half a turn about x
/// through its middle, after which its surface lies within 0.15 mm of where it was. The first is
/// none.
[[nodiscard]] std::vector<Eigen::Isometry3d> symmetries_of(const ObjectCloud& cloud);

}  // namespace dtact::whole
