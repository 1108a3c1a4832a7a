#pragma once

#include <cstddef>
#include <vector>

#include "clients/perceive/geometry/point_cloud.hpp"
#include "clients/perceive/pose/alignment.hpp"

namespace dtact::pose {

/// A tracker to compare with: NormalFlow's method (Huang, Kaess and Yuan, "NormalFlow: Fast,
/// Robust, and Accurate Contact-based Object 6DoF Pose Tracking with Vision-based Tactile Sensors",
/// IEEE RA-L 2025), written anew from its description. Rotation and sliding are those that make the
/// reference's normals, turned, equal to the frame's, least squares over all pixels of the contact,
/// Gauss–Newton from the pose before; the depth is then the heights' mean difference. Its measures
/// of shared curvature, which say when the frame before becomes the reference, are replaced by the
/// part of the contact that is shared and by how far normals still differ.
class NormalFlow {
 public:
  struct Pose {
    perceive::Motion motion;
    bool lost = false;
  };
  /// `cloud` as CloudMaker makes it of `depth` at stride 1, `view` of both.
  const Pose& follow(const perceive::DepthGrid& depth, const perceive::PointCloud& cloud,
                     const perceive::ContactView& view);

 private:
  /// A frame's contact.
  struct Reference {
    std::vector<Eigen::Vector3d> points;
    std::vector<Eigen::Vector3d> normals;
    perceive::Motion motion;
  };
  struct Fit {
    perceive::Motion motion;  ///< From the reference's frame to this one.
    double shared = 0;        ///< Part of the reference that lies on the contact.
    double differ_deg = 0;    ///< The normals, root mean square.
  };
  [[nodiscard]] static Reference reference_of(const perceive::DepthGrid& depth,
                                              const perceive::PointCloud& cloud,
                                              const perceive::ContactView& view);
  [[nodiscard]] static Fit fit(const Reference& reference, const perceive::ContactView& view,
                               const perceive::Motion& start);

  Reference reference_;
  Reference before_;
  Pose pose_;
};

}  // namespace dtact::pose
