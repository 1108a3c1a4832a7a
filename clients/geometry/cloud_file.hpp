#pragma once

#include <string>

#include "clients/geometry/point_cloud.hpp"

namespace dtact::perceive {

/// PLY, binary little-endian: the points with their normals, metres, and the triangles between
/// them. http://paulbourke.net/dataformats/ply/
[[nodiscard]] std::string encode_ply(const PointCloud& cloud);

/// PCD 0.7, binary: the same points, metres, organised as the grid with NaN where there is none.
/// https://pcl.readthedocs.io/projects/tutorials/en/latest/pcd_file_format.html
[[nodiscard]] std::string encode_pcd(const PointCloud& cloud);

}  // namespace dtact::perceive
