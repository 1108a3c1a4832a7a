#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "clients/geometry/point_cloud.hpp"

namespace dtact::perceive {

/// A point of the gel's surface. Metres, surface frame; the normal has length 1 and points away
/// from the camera, into the object.
struct Surfel {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  /// The gel's shoulder beside the object: where the object's edge is pressed deeper, the shoulder
  /// is so by `share` of it, since the gel is elastic. Elsewhere the point itself and 1.
  Eigen::Vector3d edge = Eigen::Vector3d::Zero();
  double share = 1;
};

/// The gel's surface around a contact in one frame: the object's own shape inside the contact, and
/// the gel's shoulders beside it, which move with the object.
class ContactView {
 public:
  /// `cloud` is what a CloudMaker makes of `depth` at stride 1, `table` its table
  /// (null: a plane, which
  /// `view` says where the camera sees from); both must outlive the view. `uncertainty_um`: of the
  /// depth, as the frame states it.
  ContactView(const DepthGrid& depth, const PointCloud& cloud, const SurfaceTable* table,
              double uncertainty_um, const recon::Viewpoint& view = {});

  struct Sample {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();     ///< Point of the gel, metres.
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();    ///< The gel's normal, length 1.
    Eigen::Vector3d upright = Eigen::Vector3d::UnitZ();  ///< The undeformed surface's normal.
    double depth = 0;  ///< The gel's depth, metres, positive = pressed.
    double below = 0;  ///< How deep the point asked for lies below the undeformed surface, metres.
  };
  /// The gel where the camera's ray through `point` (metres) meets it.
  /// Interpolated between four pixels; nothing outside the map and where a pixel is untrusted.
  [[nodiscard]] std::optional<Sample> at(const Eigen::Vector3d& point) const;

  /// The object lies on the gel here: no shoulder, where the depth falls off hollowly.
  [[nodiscard]] bool is_core(int column, int row) const;
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(cloud_.width) +
           static_cast<std::size_t>(column);
  }
  /// Depth from which on a pixel counts as pressed, metres.
  [[nodiscard]] double pressed() const noexcept { return pressed_; }
  /// At most about `count` of the pressed pixels, on a square grid.
  [[nodiscard]] std::vector<Surfel> surfels(std::size_t count) const;
  /// Mean of the pressed points, metres.
  [[nodiscard]] const Eigen::Vector3d& centre() const noexcept { return centre_; }
  /// Mean of the undeformed surface's normals there, of length 1.
  [[nodiscard]] const Eigen::Vector3d& upright() const noexcept { return upright_; }
  /// Area of the pressed pixels, square metres.
  [[nodiscard]] double area() const noexcept { return static_cast<double>(pixels_) * px_ * px_; }
  /// Metres.
  [[nodiscard]] double deepest() const noexcept { return deepest_; }
  /// The frame's uncertainty, metres.
  [[nodiscard]] double uncertainty() const noexcept { return uncertainty_; }
  /// Depth at a pixel, metres; NaN where it is untrusted.
  [[nodiscard]] double depth(std::size_t i) const noexcept;

  [[nodiscard]] const PointCloud& cloud() const noexcept { return cloud_; }
  /// From one pixel to the next, metres.
  [[nodiscard]] double px() const noexcept { return px_; }
  [[nodiscard]] Eigen::Vector3d point(std::size_t i) const {
    return {cloud_.part(PointCloud::kX)[i], cloud_.part(PointCloud::kY)[i],
            cloud_.part(PointCloud::kZ)[i]};
  }
  [[nodiscard]] Eigen::Vector3d normal(std::size_t i) const {
    return {cloud_.part(PointCloud::kNormalX)[i], cloud_.part(PointCloud::kNormalY)[i],
            cloud_.part(PointCloud::kNormalZ)[i]};
  }

 private:
  [[nodiscard]] double mean_depth(int column, int row) const;
  [[nodiscard]] bool is_pressed(std::size_t i) const noexcept { return depth(i) > pressed_; }
  /// The undeformed surface's normal at a pixel of the cloud.
  [[nodiscard]] Eigen::Vector3d upright_at(int column, int row) const;
  DepthGrid depth_;
  const PointCloud& cloud_;
  const SurfaceTable* table_;
  double px_;  ///< Metres.
  double x0_;  ///< x of the first column, of a plane.
  double y0_;
  double uncertainty_;
  recon::Viewpoint view_;  ///< Of a plane.
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d upright_ = Eigen::Vector3d::Zero();
  std::size_t pixels_ = 0;
  double deepest_ = 0;
  double pressed_ = 0;
};

}  // namespace dtact::perceive
