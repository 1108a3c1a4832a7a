#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "hal/sim/objects.hpp"

namespace dtact::whole {

/// A simulated object as a file has it: points with outward normals in its own frame, mm.
struct ObjectCloud {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;
};
/// Its lower side, its upper side where it has one, and walls of 1.5 mm where it ends or steps.
[[nodiscard]] ObjectCloud cloud_of(const hal::sim::Object& object);
/// The same as a PLY file.
[[nodiscard]] std::string ply_of(const ObjectCloud& cloud);
/// A cube that stands on the origin as an ASCII STL file.
[[nodiscard]] std::string cube_stl(double side_mm);
/// The 24 rotations that map that cube onto itself.
[[nodiscard]] std::vector<Eigen::Isometry3d> cube_symmetries(double side_mm);

/// The rotations about the object's z, in steps of 10, 15 and 72°, with or without half a turn
/// about x through its middle, that move its surface by less than 0.15 mm. The first is the
/// identity.
[[nodiscard]] std::vector<Eigen::Isometry3d> symmetries_of(const ObjectCloud& cloud);

}  // namespace dtact::whole
