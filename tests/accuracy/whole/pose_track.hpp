#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/accuracy/whole/pose_error.hpp"
#include "tests/accuracy/whole/sequence.hpp"

namespace dtact::perceive {
class FrameMaker;
}

namespace dtact::whole {

/// A tracker's result for a frame, millimetres.
struct TrackRow {
  std::uint64_t sequence = 0;
  bool has_pose = false;    ///< It reports the object's pose, or its last one.
  bool usable = false;      ///< The pose may be used.
  std::uint64_t since = 0;  ///< The frame that the motion is measured from.
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  std::vector<Direction> unobservable;
  double frame_us = 0;  ///< Processor time.
};

/// dtact-perceive's output for a client of points and pose. `fps`: rate of the frames, for a search
/// on a thread of its own; 0: as fast as they are processed.
[[nodiscard]] std::vector<TrackRow> perceive_track(const std::vector<std::string>& frames,
                                                   perceive::FrameMaker& maker, double fps = 0);
/// Another tracker's file: sequence,usable,since,r11…r33,x_mm,y_mm,z_mm,frame_us; no pose
/// where `since` is 0. Throws std::runtime_error naming file and line.
[[nodiscard]] std::vector<TrackRow> read_track(const std::filesystem::path& csv);

/// Three measures of the error in a frame.
struct PoseErrors {
  PoseError all;
  PoseError reported;  ///< Without the directions that the tracker reports as unobservable.
  PoseError shape;     ///< Without those of Sequence::unobservable().
};
/// Errors of the motion since the object began to move; after a restart of the tracker, of the
/// motion that it reports itself. `row`: one of `track` with a pose.
[[nodiscard]] PoseErrors motion_errors(const Sequence& sequence, const std::vector<TrackRow>& track,
                                       const TrackRow& row);
/// Errors of a known object's pose, up to its symmetries.
[[nodiscard]] PoseErrors place_errors(const Sequence& sequence, const TrackRow& row,
                                      const std::vector<Eigen::Isometry3d>& symmetries);

}  // namespace dtact::whole
