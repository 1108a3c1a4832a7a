// Judges poses against the truth on what pose_sequences wrote: dtact-perceive's, made here, and
// those of other trackers that lie beside the frames as SEQUENCE.TRACKER.track.csv (open3d_icp.py).
// Prints a line of CSV for each sequence and tracker. Errors are of the motion from the last frame
// before the object moves, with --known of the object's place, at the contact's centre: `all`,
// `reported` without the directions that the tracker reports as unobservable, `shape` without those
// that change no depth (SEQUENCE.shape.csv).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <numbers>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "clients/perceive/frame_maker.hpp"
#include "clients/perceive/object_file.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "proto/dtact.pb.h"
#include "tests/accuracy/whole/known_object.hpp"
#include "tests/accuracy/whole/moving_objects.hpp"
#include "tests/accuracy/whole/pose_track.hpp"
#include "tests/bench/cpu_time.hpp"

namespace dtact::whole {
namespace {

namespace fs = std::filesystem;

/// A sequence is followed whose frames are all within these.
constexpr double kFollowedMm = 0.3;
constexpr double kFollowedDeg = 5;

Eigen::Vector3d vector_of(const v1::Vector3& from) { return {from.x(), from.y(), from.z()}; }

/// Once ObjectPose has it, the field `valid` decides.
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
  row.told = pose.tracking() != v1::ObjectPose::SEARCHING;
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

/// What dtact-perceive makes of the frames for a client that wants points and pose. `fps`: they
/// come at that rate, for what searches on a thread of its own; 0: as fast as they are taken.
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
    maker.begin(std::move(frame), true);
    const auto encoded = maker.make(kind);
    const double took = bench::thread_us() - began;
    v1::Frame sent;
    sent.ParseFromString(encoded->body);
    rows.push_back(row_of(sent));
    rows.back().frame_us = took;
  }
  return rows;
}

/// Where the contact is, as the daemon says.
struct Contact {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double arm = 1;
};

Contact contact_of(const std::string& bytes) {
  v1::Frame frame;
  frame.ParseFromString(bytes);
  const v1::Contact& contact = frame.contact();
  constexpr double kLeastArm = 0.5;
  return {{contact.x_mm(), contact.y_mm(), 0},
          std::max(kLeastArm, std::sqrt(contact.area_mm2() / std::numbers::pi))};
}

/// A file of pose_sequences, and what belongs to it.
struct Sequence {
  std::string name;
  std::vector<TruthRow> truth;
  std::vector<std::string> frames;
  std::vector<Contact> contacts;
  std::vector<ShapeRow> shape;
  std::size_t begin = 0;  ///< Row of the last frame before the object moves.

  [[nodiscard]] std::size_t row(std::uint64_t sequence) const {
    return static_cast<std::size_t>(sequence - truth.front().sequence);
  }
  /// From one row's frame to another's.
  [[nodiscard]] Eigen::Isometry3d motion(std::size_t from, std::size_t to) const {
    return truth.at(to).pose * truth.at(from).pose.inverse();
  }
  /// The directions that changed no depth in a frame up to this one, where the object has carried
  /// them.
  [[nodiscard]] std::vector<Direction> unobservable(std::size_t at) const {
    std::vector<Direction> now;
    for (const ShapeRow& one : shape) {
      if (one.sequence > truth[at].sequence) break;
      now.push_back(carried(one.direction, motion(row(one.sequence), at)));
    }
    return now;
  }
};

Sequence load(const fs::path& folder, const std::string& name) {
  Sequence sequence;
  sequence.name = name;
  sequence.truth = read_truth(folder / (name + ".truth.csv"));
  sequence.frames = read_frames(folder / (name + ".frames"));
  const fs::path shape = folder / (name + ".shape.csv");
  if (fs::exists(shape)) sequence.shape = read_shape(shape);
  for (const std::string& frame : sequence.frames) sequence.contacts.push_back(contact_of(frame));
  const auto moves =
      std::ranges::find_if(sequence.truth, [](const auto& row) { return row.phase != "press"; });
  sequence.begin = static_cast<std::size_t>(moves - sequence.truth.begin()) - 1;
  return sequence;
}

/// The three ways to look at an error.
constexpr std::array kWays{"all", "reported", "shape"};
using Errors = std::array<PoseError, kWays.size()>;

/// Of what was found in row `i`, against what is true there.
Errors errors_of(const Sequence& sequence, std::size_t i, const TrackRow& row,
                 const Eigen::Isometry3d& found, const Eigen::Isometry3d& truth) {
  const Contact& contact = sequence.contacts[i];
  const auto error = [&](const std::vector<Direction>& without) {
    return error_of(found, truth, contact.centre, contact.arm, without);
  };
  return {error({}), error(row.unobservable), error(sequence.unobservable(i))};
}

/// Of the motion since the object began to move.
Errors motion_errors(const Sequence& sequence, const std::vector<TrackRow>& track, std::size_t i) {
  const TrackRow& row = track[i];
  const TrackRow& base = track[sequence.begin];
  if (base.since == row.since) {
    return errors_of(sequence, i, row, row.motion * base.motion.inverse(),
                     sequence.motion(sequence.begin, i));
  }
  return errors_of(sequence, i, row, row.motion, sequence.motion(sequence.row(row.since), i));
}

/// Of where the object is, up to its symmetries.
Errors place_errors(const Sequence& sequence, const std::vector<TrackRow>& track, std::size_t i,
                    const std::vector<Eigen::Isometry3d>& symmetries) {
  Errors best;
  double least = INFINITY;
  for (const Eigen::Isometry3d& symmetry : symmetries) {
    const Errors errors =
        errors_of(sequence, i, track[i], track[i].motion, sequence.truth[i].pose * symmetry);
    const double cost =
        errors[1].mm + sequence.contacts[i].arm * errors[1].deg * std::numbers::pi / 180;
    if (cost >= least) continue;
    least = cost;
    best = errors;
  }
  return best;
}

/// `part` of 1: the greatest. NaN of nothing.
double part_of(std::vector<double> values, double part) {
  if (values.empty()) return NAN;
  const auto at = values.begin() + std::lround(part * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

void print_head() {
  std::string head =
      "sequence,tracker,frames,lost,lost_in_press,restarts,followed_reported,followed_shape,"
      "reported,shape,frame_us";
  for (const char* when : {"end", "median", "worst"}) {
    for (const char* way : kWays) head += fmt::format(",{0}_{1}_mm,{0}_{1}_deg", when, way);
  }
  fmt::print("{}\n", head);
}

void print_row(const Sequence& sequence, const std::string& tracker,
               const std::vector<TrackRow>& track,
               const std::function<Errors(std::size_t)>& errors_at) {
  int lost = 0;
  int restarts = 0;
  std::vector<double> times;
  Errors end;
  std::array<std::vector<double>, kWays.size()> mm;
  std::array<std::vector<double>, kWays.size()> deg;
  for (std::size_t i = sequence.begin; i < track.size(); ++i) {
    const TrackRow& row = track[i];
    times.push_back(row.frame_us);
    const bool went_on = i > sequence.begin && row.usable && track[i - 1].usable;
    restarts += went_on && row.since != track[i - 1].since ? 1 : 0;
    lost += row.usable ? 0 : 1;
    end.fill({INFINITY, INFINITY});  // as long as nothing was told
    if (!row.told) continue;
    end = errors_at(i);
    for (std::size_t way = 0; row.usable && way < kWays.size(); ++way) {
      mm.at(way).push_back(end.at(way).mm);
      deg.at(way).push_back(end.at(way).deg);
    }
  }
  const auto lost_in_press =
      std::count_if(track.begin(), track.begin() + static_cast<std::ptrdiff_t>(sequence.begin),
                    [](const TrackRow& row) { return row.told && !row.usable; });
  const auto followed = [&](std::size_t way) {
    return lost == 0 && restarts == 0 && part_of(mm.at(way), 1) <= kFollowedMm &&
                   part_of(deg.at(way), 1) <= kFollowedDeg
               ? 1
               : 0;
  };
  std::string line =
      fmt::format("{},{},{},{},{},{},{},{},{},{},{:.0f}", sequence.name, tracker, times.size(),
                  lost, lost_in_press, restarts, followed(1), followed(2),
                  track.back().unobservable.size(), sequence.shape.size(), part_of(times, 0.5));
  for (const PoseError& error : end) line += fmt::format(",{:.4f},{:.3f}", error.mm, error.deg);
  for (const double part : {0.5, 1.0}) {
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      line += fmt::format(",{:.4f},{:.3f}", part_of(mm.at(way), part), part_of(deg.at(way), part));
    }
  }
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void judge_motion(const fs::path& folder, const Sequence& sequence) {
  perceive::FrameMaker maker;
  const auto judge = [&](const std::string& tracker, const std::vector<TrackRow>& track) {
    print_row(sequence, tracker, track,
              [&](std::size_t i) { return motion_errors(sequence, track, i); });
  };
  judge("dtact-perceive", perceive_track(sequence.frames, maker, 0));
  std::vector<fs::path> others;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string other = entry.path().filename();
    if (other.starts_with(sequence.name + ".") && other.ends_with(".track.csv")) {
      others.push_back(entry.path());
    }
  }
  std::ranges::sort(others);
  for (const fs::path& other : others) {
    judge(other.stem().stem().extension().string().substr(1), read_track(other));
  }
}

/// The object's shape comes from a file, as for a user.
void judge_known(const fs::path& folder, const Sequence& sequence) {
  constexpr double kFps = 60;
  const std::string name = sequence.name.substr(0, sequence.name.find('.'));
  const auto* const object = std::ranges::find(kMovingObjects, name, &MovingObject::name);
  if (object == kMovingObjects.end()) return;
  const hal::sim::Scene scene = hal::sim::parse_scene(
      fmt::format("[[press]]\n{}\nkeys = [{{ t = 0.0 }}]\n", object->lines), name);
  const ObjectCloud cloud = cloud_of(scene.presses.at(0).object);
  const auto symmetries = symmetries_of(cloud);
  const auto judge = [&](const std::string& tracker, const fs::path& file,
                         const std::string& shape) {
    base::write_file_atomically(file, shape);
    perceive::FrameMaker maker(perceive::load_object(file, "mm"));
    const auto track = perceive_track(sequence.frames, maker, kFps);
    print_row(sequence, tracker, track,
              [&](std::size_t i) { return place_errors(sequence, track, i, symmetries); });
  };
  judge("cloud", folder / (name + ".ply"), ply_of(cloud));
  if (name == "cube") judge("mesh", folder / (name + ".stl"), cube_stl(5));
}

void judge_all(const fs::path& folder, const std::vector<std::string>& only, bool known) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string file = entry.path().filename();
    const bool wanted = only.empty() || std::ranges::any_of(only, [&](const auto& part) {
                          return file.find(part) != std::string::npos;
                        });
    constexpr std::string_view kEnd = ".truth.csv";
    if (wanted && file.ends_with(kEnd)) names.push_back(file.substr(0, file.size() - kEnd.size()));
  }
  std::ranges::sort(names);
  print_head();
  for (const std::string& name : names) {
    const Sequence sequence = load(folder, name);
    known ? judge_known(folder, sequence) : judge_motion(folder, sequence);
  }
}

}  // namespace
}  // namespace dtact::whole

int main(int argc, char** argv) {
  try {
    CLI::App app("Judges poses on the sequences of a folder against the truth");
    std::string folder;
    std::vector<std::string> only;
    bool known = false;
    app.add_option("folder", folder, "That pose_sequences wrote")->required();
    app.add_option("--only", only, "Sequences whose name holds this; may be repeated");
    app.add_flag("--known", known, "The object's shape is known: its place, in real time");
    CLI11_PARSE(app, argc, argv);
    dtact::whole::judge_all(folder, only, known);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "pose_judge: {}\n", e.what());
    return 1;
  }
}
