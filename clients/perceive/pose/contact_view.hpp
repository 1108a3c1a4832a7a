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

/// What one frame shows of the object: its shape where it touches, and nothing elsewhere.
class ContactView {
 public:
  /// `cloud` is what a CloudMaker makes of `depth` at stride 1, `table` its table (null: a plane);
  /// all must outlive the view.
  ContactView(const DepthGrid& depth, const PointCloud& cloud, const SurfaceTable* table,
              double uncertainty_um);

  /// How the normal changes with the place, along two axes of the untouched surface (of a plane x
  /// and y).
  struct Bend {
    Eigen::Matrix<double, 3, 2> axes;
    /// Of the normal's part along each axis, for each metre of a shift.
    Eigen::Matrix<double, 2, 3> change;
  };
  struct Sample {
    Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< Metres.
    Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
    /// Nothing where the pixels that it is taken between do not touch.
    std::optional<Bend> bend;
  };
  /// The gel's surface where the untouched surface's normal through `point` (metres) crosses it,
  /// between the pixels around; nothing where one of them does not touch.
  [[nodiscard]] std::optional<Sample> at(const Eigen::Vector3d& point) const;

  /// At most `most` points, alike many of each direction that the surface looks in: spread().
  [[nodiscard]] std::vector<Surfel> choose(std::size_t most) const;
  /// The mean of all that touches.
  [[nodiscard]] const Eigen::Vector3d& centre() const noexcept { return centre_; }
  /// The mean of the untouched surface's normals there, of length 1.
  [[nodiscard]] const Eigen::Vector3d& upright() const noexcept { return upright_; }
  /// Of all that touches, square metres; alike at each of the map's resolutions.
  [[nodiscard]] double area() const noexcept { return static_cast<double>(pixels_) * px_ * px_; }
  /// Of all that touches, metres.
  [[nodiscard]] double deepest() const noexcept { return deepest_; }

  /// The points that it is of; a pixel's index in them.
  [[nodiscard]] const PointCloud& cloud() const noexcept { return cloud_; }
  [[nodiscard]] bool touches(std::size_t i) const noexcept { return touching_[i] != 0; }
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
  /// Between the pixels of the cloud.
  struct Place {
    double column = 0;
    double row = 0;
    Eigen::Vector3d upright = Eigen::Vector3d::UnitZ();
  };
  [[nodiscard]] std::optional<Place> place_of(const Eigen::Vector3d& point) const;
  /// Of a curved surface.
  [[nodiscard]] Eigen::Vector3d upright_at(int column, int row) const;
  [[nodiscard]] std::optional<Bend> bend_at(int column, int row,
                                            const Eigen::Vector3d& upright) const;
  [[nodiscard]] std::size_t index(int column, int row) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(cloud_.width) +
           static_cast<std::size_t>(column);
  }
  const PointCloud& cloud_;
  const SurfaceTable* table_;
  std::vector<std::uint8_t> touching_;
  double px_;  ///< Metres.
  int reach_;  ///< Pixels to each side that the normals' change is taken over.
  double x0_;  ///< Of the first column of a plane.
  double y0_;
  Eigen::Vector3d centre_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d upright_ = Eigen::Vector3d::Zero();
  std::size_t pixels_ = 0;
  double deepest_ = 0;
};

}  // namespace dtact::perceive
