#include "tests/accuracy/whole/pose_track.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "hal/base/atomic_file.hpp"
#include "proto/framing.hpp"

namespace dtact::whole {
namespace {

using Twist = Eigen::Matrix<double, 6, 1>;

/// The one twist about `centre` (rotation times `arm`) that going along for a while is `motion`.
Twist screw_of(const Eigen::Isometry3d& motion, const Eigen::Vector3d& centre, double arm) {
  const Eigen::AngleAxisd turn(motion.rotation());
  const Eigen::Vector3d shift = motion * centre - centre;
  Twist twist;
  twist.head<3>() = arm * turn.angle() * turn.axis();
  // The inverse of the left Jacobian of SO(3): Barfoot, State Estimation for Robotics, 7.1.3.
  const double half = turn.angle() / 2;
  const double cotangent = half < 1e-6 ? 1 : half / std::tan(half);
  twist.tail<3>() = cotangent * shift + (1 - cotangent) * turn.axis() * turn.axis().dot(shift) -
                    half * turn.axis().cross(shift);
  return twist;
}

/// The same direction about another centre and arm, not of unit length.
Twist about(const Direction& direction, const Eigen::Vector3d& centre, double arm) {
  const Eigen::Vector3d rotation = direction.twist.head<3>() / direction.arm;
  Twist twist;
  twist.head<3>() = arm * rotation;
  twist.tail<3>() = direction.twist.tail<3>() + rotation.cross(centre - direction.centre);
  return twist;
}

/// Calls back with the fields of each line but the first. Throws where they are too few.
void for_each_line(const std::filesystem::path& csv,
                   const std::function<void(std::istream&)>& read) {
  std::istringstream lines(base::read_file(csv));
  std::string line;
  std::getline(lines, line);
  for (int number = 2; std::getline(lines, line); ++number) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream fields(line);
    read(fields);
    if (!fields.fail()) continue;
    throw std::runtime_error(
        fmt::format("{}, line {}: too few columns: write the file again", csv.string(), number));
  }
}

void read_pose(std::istream& fields, Eigen::Isometry3d& pose) {
  pose.setIdentity();
  for (int i = 0; i < 9; ++i) fields >> pose.linear()(i / 3, i % 3);
  for (double& value : pose.translation()) fields >> value;
}

}  // namespace

std::vector<TruthRow> read_truth(const std::filesystem::path& csv) {
  std::vector<TruthRow> rows;
  for_each_line(csv, [&](std::istream& fields) {
    TruthRow& row = rows.emplace_back();
    bool touching = false;
    fields >> row.sequence >> touching;
    read_pose(fields, row.pose);
    fields >> row.phase;
  });
  return rows;
}

std::vector<TrackRow> read_track(const std::filesystem::path& csv) {
  std::vector<TrackRow> rows;
  for_each_line(csv, [&](std::istream& fields) {
    TrackRow& row = rows.emplace_back();
    fields >> row.sequence >> row.usable >> row.since;
    read_pose(fields, row.motion);
    fields >> row.frame_us;
    row.told = row.since != 0;
  });
  return rows;
}

std::vector<ShapeRow> read_shape(const std::filesystem::path& csv) {
  constexpr double kLeastShown = 0.05;
  std::vector<ShapeRow> rows;
  for_each_line(csv, [&](std::istream& fields) {
    ShapeRow row;
    double shown = 0;
    fields >> row.sequence;
    for (double& value : row.direction.centre) fields >> value;
    fields >> row.direction.arm >> shown;
    for (double& value : row.direction.twist) fields >> value;
    if (shown < kLeastShown) rows.push_back(row);
  });
  return rows;
}

std::vector<std::string> read_frames(const std::filesystem::path& file) {
  constexpr std::size_t kMost = std::size_t{4} << 30U;
  const std::string bytes = base::read_file(file, kMost);
  std::string_view rest = bytes;
  wire::MessageDecoder decoder;
  std::vector<std::string> frames;
  while (decoder.feed(rest) == wire::MessageDecoder::Result::message) {
    frames.push_back(decoder.message());
  }
  if (frames.empty() || !rest.empty()) {
    throw std::runtime_error(
        fmt::format("{} is not whole: write it again with pose_sequences", file.string()));
  }
  return frames;
}

Direction carried(const Direction& direction, const Eigen::Isometry3d& motion) {
  Direction moved = direction;
  moved.centre = motion * direction.centre;
  moved.twist.head<3>() = motion.linear() * direction.twist.head<3>();
  moved.twist.tail<3>() = motion.linear() * direction.twist.tail<3>();
  return moved;
}

PoseError error_of(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                   const Eigen::Vector3d& centre, double arm,
                   const std::vector<Direction>& without) {
  Twist off = screw_of(found * truth.inverse(), centre, arm);
  if (!without.empty()) {
    Eigen::Matrix<double, 6, Eigen::Dynamic> span(6, std::ssize(without));
    for (std::size_t i = 0; i < without.size(); ++i) {
      span.col(static_cast<Eigen::Index>(i)) = about(without[i], centre, arm);
    }
    off -= span * span.colPivHouseholderQr().solve(off);
  }
  return {off.tail<3>().norm(), off.head<3>().norm() / arm * 180 / M_PI};
}

}  // namespace dtact::whole
