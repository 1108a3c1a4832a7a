#include "tests/accuracy/whole/pose_track.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <cmath>
#include <cstddef>
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

}  // namespace

std::vector<TruthRow> read_truth(const std::filesystem::path& csv) {
  std::istringstream lines(base::read_file(csv));
  std::string line;
  std::getline(lines, line);
  std::vector<TruthRow> rows;
  while (std::getline(lines, line)) {
    std::istringstream fields(line);
    std::string field;
    const auto next = [&] {
      if (std::getline(fields, field, ',')) return field;
      throw std::runtime_error(
          fmt::format("{}, line {}: too few columns: write it again with "
                      "pose_sequences",
                      csv.string(), rows.size() + 2));
    };
    TruthRow row;
    row.sequence = std::stoull(next());
    (void)next();  // in_contact
    row.pose = Eigen::Isometry3d::Identity();
    for (int i = 0; i < 9; ++i) row.pose.linear()(i / 3, i % 3) = std::stod(next());
    for (int i = 0; i < 3; ++i) row.pose.translation()[i] = std::stod(next());
    row.phase = next();
    rows.push_back(row);
  }
  return rows;
}

std::vector<std::string> read_frames(const std::filesystem::path& file) {
  const std::string bytes = base::read_file(file);
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
