#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "clients/geometry/mesh_file.hpp"
#include "clients/perceive/pose/contact_view.hpp"

namespace dtact::perceive {

/// A known object: surfels all over its surface in the frame of its file, metres, their normals
/// pointing into it.
struct ObjectModel {
  std::string name;
  std::vector<Surfel> surfels;
  double spacing = 0;  ///< From one surfel to the next, metres.
  /// Outward unit directions on which it rests when it lies on a plane, as a cube's six.
  std::vector<Eigen::Vector3d> rests;
};

/// Samples `mesh`, whose unit is `metres_per_unit`: triangles alike densely whatever their size,
/// then one surfel of a direction in each cell of a grid. Surfels are 0.15 mm apart, or as far as
/// kMaxSurfels of them or a cloud's own density allow. Throws std::runtime_error with a sentence
/// that says what is wrong with the shape: its size in this unit, that its surface looks inwards,
/// or that a cloud is so sparse that its gaps would be taken for holes.
[[nodiscard]] ObjectModel make_object(const Mesh& mesh, double metres_per_unit, std::string name);

/// Unit vectors evenly all over the sphere (Fibonacci's lattice): of 1600 the next is 5° away.
[[nodiscard]] std::vector<Eigen::Vector3d> all_directions(int count);

constexpr std::size_t kMaxSurfels = 20'000;
/// Metres; surfels further apart fit where the object does not: of a simulated object of balls,
/// 0.26 mm apart, each place was found, and at 0.37 mm places that were millimetres off.
constexpr double kCoarse = 3e-4;
/// Across its bounding box, millimetres.
constexpr double kMinObjectMm = 0.5;
constexpr double kMaxObjectMm = 300;

}  // namespace dtact::perceive
