#include "tests/accuracy/whole/pose_track.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <thread>
#include <utility>

#include "clients/perceive/frame_maker.hpp"
#include "proto/dtact.pb.h"
#include "tests/bench/cpu_time.hpp"

namespace dtact::whole {
namespace {

Eigen::Vector3d vector_of(const v1::Vector3& from) { return {from.x(), from.y(), from.z()}; }

/// The field `valid` decides once ObjectPose is set.
bool is_usable(const v1::ObjectPose& pose) {
  if (const auto* valid = v1::ObjectPose::descriptor()->FindFieldByName("valid")) {
    return pose.GetReflection()->GetBool(pose, valid);
  }
  return pose.tracking() != v1::ObjectPose::LOST && pose.tracking() != v1::ObjectPose::SEARCHING;
}

TrackRow row_of(const v1::Frame& frame) {
  TrackRow row;
  row.sequence = frame.sequence();
  if (!frame.has_pose()) return row;
  const v1::ObjectPose& pose = frame.pose();
  row.has_pose = pose.tracking() != v1::ObjectPose::SEARCHING;
  row.usable = is_usable(pose);
  row.since = pose.since_sequence();
  const Eigen::Vector3d turn = vector_of(pose.rotation_deg()) * std::numbers::pi / 180;
  if (turn.norm() > 0) row.motion = Eigen::AngleAxisd(turn.norm(), turn.normalized());
  row.motion.pretranslate(vector_of(pose.translation_mm()));
  for (const v1::Twist& twist : pose.unobservable()) {
    Direction direction{vector_of(pose.centre_mm()), pose.arm_mm(), {}};
    direction.twist << vector_of(twist.rotation()), vector_of(twist.translation());
    row.unobservable.push_back(direction);
  }
  return row;
}

/// The contact that the daemon reports.
struct Contact {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double arm = 1;
};

Contact contact_of(const std::string& bytes) {
  v1::Frame frame;
  frame.ParseFromString(bytes);
  const v1::Contact& contact = frame.contact();
  constexpr double kMinArm = 0.5;
  return {{contact.x_mm(), contact.y_mm(), 0},
          std::max(kMinArm, std::sqrt(contact.area_mm2() / std::numbers::pi))};
}

/// Errors of the pose found in a row, against the truth there.
PoseErrors errors_of(const Sequence& sequence, const TrackRow& row, const Eigen::Isometry3d& found,
                     const Eigen::Isometry3d& truth) {
  const std::size_t at = sequence.index(row.sequence);
  const Contact contact = contact_of(sequence.frames.at(at));
  const auto error = [&](const std::vector<Direction>& without) {
    return error_of(found, truth, contact.centre, contact.arm, without);
  };
  return {error({}), error(row.unobservable), error(sequence.unobservable(at))};
}

}  // namespace

std::vector<TrackRow> perceive_track(const std::vector<std::string>& frames,
                                     perceive::FrameMaker& maker, double fps) {
  const net::FrameKind kind{.contact_box = true, .cloud = v1::CLOUD_INT16, .pose = true};
  auto due = std::chrono::steady_clock::now();
  std::vector<TrackRow> rows;
  for (const std::string& bytes : frames) {
    v1::Frame frame;
    frame.ParseFromString(bytes);
    if (fps > 0) {
      due += std::chrono::nanoseconds(std::lround(1e9 / fps));
      std::this_thread::sleep_until(due);
    }
    const double began = bench::thread_us();
    maker.begin(std::move(frame), {.pose = true});
    const auto encoded = maker.make(kind);
    const double took = bench::thread_us() - began;
    v1::Frame sent;
    sent.ParseFromString(encoded->body);
    rows.push_back(row_of(sent));
    rows.back().frame_us = took;
  }
  return rows;
}

std::vector<TrackRow> read_track(const std::filesystem::path& csv) {
  std::vector<TrackRow> rows;
  for_each_line(csv, [&](std::istream& fields) {
    TrackRow& row = rows.emplace_back();
    fields >> row.sequence >> row.usable >> row.since;
    read_pose(fields, row.motion);
    fields >> row.frame_us;
    row.has_pose = row.since != 0;
  });
  if (rows.empty()) throw std::runtime_error(csv.string() + " has no frames: write it again");
  return rows;
}

PoseErrors motion_errors(const Sequence& sequence, const std::vector<TrackRow>& track,
                         const TrackRow& row) {
  const std::size_t begin = sequence.begin();
  const std::size_t at = sequence.index(row.sequence);
  const auto base =
      std::ranges::find(track, sequence.truth.at(begin).sequence, &TrackRow::sequence);
  if (base != track.end() && base->since == row.since) {
    return errors_of(sequence, row, row.motion * base->motion.inverse(),
                     sequence.motion(begin, at));
  }
  return errors_of(sequence, row, row.motion, sequence.motion(sequence.index(row.since), at));
}

PoseErrors place_errors(const Sequence& sequence, const TrackRow& row,
                        const std::vector<Eigen::Isometry3d>& symmetries) {
  const std::size_t at = sequence.index(row.sequence);
  const double arm = contact_of(sequence.frames.at(at)).arm;
  PoseErrors best;
  double least = INFINITY;
  for (const Eigen::Isometry3d& symmetry : symmetries) {
    const PoseErrors errors =
        errors_of(sequence, row, row.motion, sequence.truth.at(at).pose * symmetry);
    const double cost = errors.reported.mm + arm * errors.reported.deg * std::numbers::pi / 180;
    if (cost >= least) continue;
    least = cost;
    best = errors;
  }
  return best;
}

}  // namespace dtact::whole
