#pragma once

#include "clients/geometry/point_cloud.hpp"

namespace dtact::v1 {
class PointCloud;
}

namespace dtact::perceive {

/// The cloud in a dtact.v1.CloudEncoding. Values are little-endian, as are the machines this runs
/// on.
void fill(const PointCloud& cloud, int encoding, v1::PointCloud& out);

}  // namespace dtact::perceive
