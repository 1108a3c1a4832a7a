#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace dtact::whole {

// Lengths are millimetres, poses are in the surface frame.

/// What is true of a frame, as pose_sequences writes it.
struct TruthRow {
  std::uint64_t sequence = 0;
  Eigen::Isometry3d pose;  ///< From the object's frame.
  std::string phase;       ///< "press", "motion" or "end".
};
/// Throws std::runtime_error naming file and line.
[[nodiscard]] std::vector<TruthRow> read_truth(const std::filesystem::path& csv);

/// The serialised v1::Frames of a file of pose_sequences. Throws std::runtime_error naming it.
[[nodiscard]] std::vector<std::string> read_frames(const std::filesystem::path& file);

/// A direction of motion as on the wire: a unit twist about `centre`, its rotation times `arm`.
struct Direction {
  Eigen::Vector3d centre;
  double arm = 1;
  Eigen::Matrix<double, 6, 1> twist;  ///< Rotation, then translation.
};

/// What a tracker says of a frame.
struct TrackRow {
  std::uint64_t sequence = 0;
  bool usable = false;      ///< There is a pose, and it may be used.
  std::uint64_t since = 0;  ///< The frame that the motion is measured from.
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  std::vector<Direction> unobservable;
  double frame_us = 0;  ///< Processor time, points included.
};

/// Of a motion that was found against the true one, split at the contact's centre.
struct PoseError {
  double mm = 0;
  double deg = 0;
};
/// Without its part along `without`. `centre` and `arm` (mm): of the contact.
[[nodiscard]] PoseError error_of(const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth,
                                 const Eigen::Vector3d& centre, double arm,
                                 const std::vector<Direction>& without);

}  // namespace dtact::whole
