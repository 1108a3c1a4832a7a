#include "tests/accuracy/whole/shape.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "hal/sim/elastic_layer.hpp"
#include "hal/sim/grid.hpp"
#include "hal/sim/placement.hpp"

namespace dtact::whole {
namespace {

using hal::sim::PressKey;

constexpr double kStepMm = 0.2;
/// Shallower pixels do not count.
constexpr double kMinDeepMm = 0.06;
constexpr double kMinArmMm = 0.5;

double degrees(double radians) { return radians * 180 / M_PI; }

Eigen::Isometry3d pose_at(const hal::sim::Scene& scene, const PressKey& key) {
  return isometry_of(pose_of(scene.surface, scene.presses[0].object, key));
}

/// The key that gives the object this pose.
PressKey key_of(const hal::sim::Scene& scene, const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d up = pose.linear().col(2);
  const auto tilt = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up);
  const Eigen::AngleAxisd tilted(tilt);
  const Eigen::Matrix3d in_plane = tilt.inverse() * pose.linear();
  PressKey key;
  key.x_mm = pose.translation().x();
  key.y_mm = pose.translation().y();
  key.rotation_deg = degrees(std::atan2(in_plane(1, 0), in_plane(0, 0)));
  key.tilt_x_deg = degrees(tilted.angle() * tilted.axis().x());
  key.tilt_y_deg = degrees(tilted.angle() * tilted.axis().y());
  key.depth_mm = pose_at(scene, key).translation().z() - pose.translation().z();
  return key;
}

/// The gel under the object at any pose.
class GelSolver {
 public:
  GelSolver(const hal::sim::Scene& scene, const hal::sim::Grid& grid)
      : scene_(scene),
        grid_(grid),
        layer_(grid_.width, grid_.height, grid_.spacing_mm, scene_.gel.thickness_mm,
               scene_.gel.poisson) {}

  hal::sim::Pressed press(const Eigen::Isometry3d& pose) {
    cv::Mat1d target(grid_.height, grid_.width, -hal::sim::kNoSurface);
    lower_object(scene_.surface, scene_.presses[0].object, key_of(scene_, pose),
                 scene_.gel.thickness_mm, grid_, target);
    hal::sim::Pressed pressed = layer_.solve(target, guess_);
    guess_ = pressed.pressure;
    return pressed;
  }

 private:
  const hal::sim::Scene& scene_;
  const hal::sim::Grid& grid_;
  hal::sim::ElasticLayer layer_;
  cv::Mat1d guess_;
};

Eigen::Isometry3d moved(const Eigen::Isometry3d& pose, const Direction& by, double mm) {
  const Eigen::Vector3d turn = by.twist.head<3>() * (mm / by.arm);
  Eigen::Isometry3d motion(Eigen::Translation3d(mm * by.twist.tail<3>()));
  motion.translate(by.centre);
  if (turn.norm() > 0) motion.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  motion.translate(-by.centre);
  return motion * pose;
}

}  // namespace

Eigen::Isometry3d isometry_of(const hal::sim::Pose& pose) {
  const Eigen::Vector3d turn(pose.turn_deg[0], pose.turn_deg[1], pose.turn_deg[2]);
  Eigen::Isometry3d isometry(Eigen::Translation3d(pose.x_mm, pose.y_mm, pose.z_mm));
  if (turn.norm() > 0) {
    isometry.rotate(Eigen::AngleAxisd(turn.norm() * M_PI / 180, turn.normalized()));
  }
  return isometry;
}

std::array<ShownDirection, 6> shown_directions(const hal::sim::Scene& curved,
                                               std::uint64_t sequence) {
  hal::sim::Scene scene = curved;
  scene.surface = {};
  const hal::sim::Grid grid = hal::sim::make_grid(scene);
  const auto key = hal::sim::key_at(scene.presses.at(0), scene.time_s(sequence)).value();
  const Eigen::Isometry3d pose = pose_at(scene, key);
  GelSolver gel(scene, grid);
  const hal::sim::Pressed here = gel.press(pose);

  Direction about{Eigen::Vector3d::Zero(), 0, Eigen::Matrix<double, 6, 1>::Zero()};
  int in_contact = 0;
  for (int i = 0; i < grid.height; ++i) {
    for (int k = 0; k < grid.width; ++k) {
      if (here.pressure(i, k) <= 0) continue;
      ++in_contact;
      about.centre +=
          Eigen::Vector3d(grid.x0_mm + k * grid.spacing_mm, grid.y0_mm + i * grid.spacing_mm, 0);
    }
  }
  about.centre /= std::max(1, in_contact);
  about.arm = std::max(kMinArmMm, std::sqrt(in_contact / M_PI) * grid.spacing_mm);

  cv::Mat1b deep;
  cv::compare(here.indentation_mm, kMinDeepMm, deep, cv::CMP_GT);
  std::array<cv::Mat1d, 6> change;
  for (std::size_t i = 0; i < change.size(); ++i) {
    Direction one = about;
    one.twist[static_cast<Eigen::Index>(i)] = 1;
    const cv::Mat1d there = gel.press(moved(pose, one, kStepMm)).indentation_mm;
    const cv::Mat1d back = gel.press(moved(pose, one, -kStepMm)).indentation_mm;
    change.at(i) = cv::Mat1d::zeros(grid.height, grid.width);
    cv::Mat1d((there - back) / (2 * kStepMm)).copyTo(change.at(i), deep);
  }
  Eigen::Matrix<double, 6, 6> normal;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t k = 0; k < 6; ++k) {
      normal(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          change.at(i).dot(change.at(k)) / std::max(1, cv::countNonZero(deep));
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> spectrum(normal);
  const Eigen::Isometry3d laid_round = pose_at(curved, key) * pose.inverse();
  std::array<ShownDirection, 6> directions;
  for (int i = 0; i < 6; ++i) {
    auto& one = directions.at(static_cast<std::size_t>(i));
    one.direction = about;
    one.direction.twist = spectrum.eigenvectors().col(i);
    one.direction = carried(one.direction, laid_round);
    one.shown = std::sqrt(std::max(0.0, spectrum.eigenvalues()[i]));
  }
  return directions;
}

}  // namespace dtact::whole
