#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <istream>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hal/sim/truth.hpp"
#include "tests/accuracy/whole/moving_objects.hpp"
#include "tests/accuracy/whole/pose_error.hpp"

namespace dtact::whole {

/// The truth of a frame. Lengths are millimetres, poses are in the map's surface frame.
struct TruthRow {
  std::uint64_t sequence = 0;
  bool in_contact = false;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< From the object's frame.
  std::string phase;                                       ///< "press", "motion" or "end".
};

/// A direction of motion in a frame, and how much of it the gel shows.
struct ShapeRow {
  std::uint64_t sequence = 0;
  Direction direction;
  double shown = 0;  ///< ShownDirection::shown.
  /// Directions that show less count as unobservable.
  static constexpr double kMinShown = 0.05;
};

/// One object that is pressed in and then moves: the daemon's frames and the truth.
struct Sequence {
  std::string name;
  std::vector<TruthRow> truth;      ///< One of each frame, their sequences without gaps.
  std::vector<std::string> frames;  ///< Serialised v1::Frames.
  std::vector<ShapeRow> shape;      ///< Six of some frames.

  /// The last frame before the object moves.
  [[nodiscard]] std::size_t begin() const;
  /// Index of a camera frame in `truth` and `frames`.
  [[nodiscard]] std::size_t index(std::uint64_t sequence) const;
  /// The object's motion from one frame to another, both indices into `truth`.
  [[nodiscard]] Eigen::Isometry3d motion(std::size_t from, std::size_t to) const;
  /// The directions that were unobservable in any frame up to this one, moved with the object.
  [[nodiscard]] std::vector<Direction> unobservable(std::size_t at) const;
};

/// How much the gel shows at five moments of a motion, in the simulator's surface frame.
[[nodiscard]] std::vector<ShapeRow> shape_of(const hal::sim::Scene& scene,
                                             const MotionFrames& frames);

/// Runs the program on a choreography and passes a sequence for each motion, named
/// OBJECT.MOTION. `shapes`: shape_of() of each.
void record(const std::shared_ptr<const hal::sim::Truth>& truth,
            const std::filesystem::path& calibration, const MovingObject& object,
            std::span<const ObjectMotion> motions, std::span<const MotionFrames> choreography,
            std::span<const std::vector<ShapeRow>> shapes,
            const std::function<void(const Sequence&)>& done);

/// NAME.frames: each frame as on the wire, a big-endian length of four bytes and a v1::Frame.
/// NAME.truth.csv and NAME.shape.csv: a line for each row.
void save(const Sequence& sequence, const std::filesystem::path& folder);
/// Throws std::runtime_error naming file and line. The shape may be missing.
[[nodiscard]] Sequence load(const std::filesystem::path& folder, const std::string& name);

/// Calls back with the fields of each line of a CSV file but the first. Throws std::runtime_error
/// naming file and line where they are too few.
void for_each_line(const std::filesystem::path& csv,
                   const std::function<void(std::istream&)>& read);
/// Nine numbers of the rotation, row by row, and three of the translation.
void read_pose(std::istream& fields, Eigen::Isometry3d& pose);

}  // namespace dtact::whole
