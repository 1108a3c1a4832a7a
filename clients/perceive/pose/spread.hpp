#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace dtact::perceive {

/// Which of `normals` (unit vectors) to take: at most `most`, alike many of each direction, so that
/// a few edges count beside a large flat (Rusinkiewicz and Levoy, Efficient Variants of the ICP
/// Algorithm, 3DIM 2001: normal-space sampling). The same for the same ones.
[[nodiscard]] std::vector<std::size_t> spread(std::span<const Eigen::Vector3d> normals,
                                              std::size_t most);

}  // namespace dtact::perceive
