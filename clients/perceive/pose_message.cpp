#include "clients/perceive/pose_message.hpp"

#include <Eigen/Geometry>
#include <numbers>

#include "proto/dtact.pb.h"

namespace dtact::perceive {
namespace {

void fill(const Eigen::Vector3d& vector, v1::Vector3& out) {
  out.set_x(vector.x());
  out.set_y(vector.y());
  out.set_z(vector.z());
}

v1::ObjectPose::Tracking to_wire(Tracker::State state) {
  switch (state) {
    case Tracker::State::idle:
      return v1::ObjectPose::UNSPECIFIED;
    case Tracker::State::started:
      return v1::ObjectPose::STARTED;
    case Tracker::State::tracked:
      return v1::ObjectPose::TRACKED;
    case Tracker::State::lost:
      return v1::ObjectPose::LOST;
    case Tracker::State::recovered:
      return v1::ObjectPose::RECOVERED;
    case Tracker::State::searching:
      return v1::ObjectPose::SEARCHING;
  }
  return v1::ObjectPose::UNSPECIFIED;
}

}  // namespace

void fill(const Tracker::Pose& pose, v1::ObjectPose& out) {
  constexpr double kMillimetres = 1e3;
  const Alignment& found = pose.alignment;
  out.set_tracking(to_wire(pose.state));
  out.set_valid(pose.valid());
  if (pose.state == Tracker::State::searching) return;
  out.set_since_sequence(pose.since);
  fill(kMillimetres * found.motion.translation(), *out.mutable_translation_mm());
  const Eigen::AngleAxisd turn(found.motion.linear());
  fill(turn.angle() * 180 / std::numbers::pi * turn.axis(), *out.mutable_rotation_deg());
  for (const Twist& direction : pose.unobservable) {
    auto& twist = *out.add_unobservable();
    fill(Eigen::Vector3d(direction.head<3>()), *twist.mutable_rotation());
    fill(Eigen::Vector3d(direction.tail<3>()), *twist.mutable_translation());
  }
  fill(kMillimetres * found.centre, *out.mutable_centre_mm());
  out.set_arm_mm(kMillimetres * found.arm);
  out.set_residual_um(1e6 * found.rms);
  out.set_points(static_cast<std::uint32_t>(found.points));
  out.set_alternatives(pose.alternatives);
}

}  // namespace dtact::perceive
