#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "clients/perceive/geometry/point_cloud.hpp"

namespace dtact::perceive {

/// A point of the touched object: where it touches, the gel's surface is its own. Metres, surface
/// frame; the normal is the gel's, into the object.
struct Surfel {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// What one frame of a flat sensor shows of the object: its shape where it touches, and nothing
/// elsewhere.
class ContactView {
 public:
  /// `cloud` is what CloudMaker makes of `depth` at stride 1; both must outlive the view.
  ContactView(const DepthGrid& depth, const PointCloud& cloud, double uncertainty_um);

  struct Sample {
    double z = 0;  ///< Metres.
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
    /// How the normal's x and y change along x (first column) and y, per metre; nothing where the
    /// pixels that it is taken between do not touch.
    std::optional<Eigen::Matrix2d> bend;
  };
  /// The surface at a place, between the pixels around it; nothing where one of them does not
  /// touch.
  [[nodiscard]] std::optional<Sample> at(double x, double y) const;

  /// At most `most` points, alike many of each direction that the surface looks in, so that a few
  /// edges count beside a large flat (Rusinkiewicz and Levoy, Efficient Variants of the ICP
  /// Algorithm, 3DIM 2001: normal-space sampling). The same for the same map.
  [[nodiscard]] std::vector<Surfel> choose(std::size_t most) const;
  /// The mean of all that touches; z of the surface.
  [[nodiscard]] const Eigen::Vector3d& centre() const noexcept { return centre_; }
  [[nodiscard]] std::size_t pixels() const noexcept { return pixels_; }

 private:
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(cloud_.width) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] Eigen::Vector3d normal(std::size_t i) const {
    return {cloud_.part(PointCloud::kNormalX)[i], cloud_.part(PointCloud::kNormalY)[i],
            cloud_.part(PointCloud::kNormalZ)[i]};
  }

  const PointCloud& cloud_;
  std::vector<std::uint8_t> touching_;
  double px_;  ///< Metres.
  double x0_;  ///< Of the first column.
  double y0_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  std::size_t pixels_ = 0;
};

}  // namespace dtact::perceive
