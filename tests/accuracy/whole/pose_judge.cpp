// Judges poses against the truth on what pose_sequences wrote: dtact-perceive's, made here, and
// those of other trackers that lie beside the frames as SEQUENCE.TRACKER.track.csv (open3d_icp.py).
// Prints a line of CSV for each sequence and tracker. Errors are of the motion from the last frame
// before the object moves, at the contact's centre: `all`, `reported` without the directions that
// the tracker reports as unobservable, `shape` without those that change no depth
// (SEQUENCE.shape.csv).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "clients/perceive/frame_maker.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/dtact.pb.h"
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

/// What dtact-perceive makes of the frames for a client that wants points and pose.
std::vector<TrackRow> perceive_track(const std::vector<std::string>& frames) {
  const net::FrameKind kind{.contact_box = true, .cloud = v1::CLOUD_INT16, .pose = true};
  perceive::FrameMaker maker;
  std::vector<TrackRow> rows;
  for (const std::string& bytes : frames) {
    v1::Frame frame;
    frame.ParseFromString(bytes);
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

/// sequence,usable,since,r11…r33,x_mm,y_mm,z_mm,frame_us
std::vector<TrackRow> read_track(const fs::path& csv) {
  std::istringstream lines(base::read_file(csv));
  std::string line;
  std::getline(lines, line);
  std::vector<TrackRow> rows;
  while (std::getline(lines, line)) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream fields(line);
    TrackRow row;
    fields >> row.sequence >> row.usable >> row.since;
    for (int i = 0; i < 9; ++i) fields >> row.motion.linear()(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) fields >> row.motion.translation()[i];
    fields >> row.frame_us;
    rows.push_back(row);
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

/// The directions that change no depth in the frames up to each that was looked at.
struct ShapeRow {
  std::uint64_t sequence = 0;
  Direction direction;
};

std::vector<ShapeRow> read_shape(const fs::path& csv) {
  if (!fs::exists(csv)) return {};
  std::istringstream lines(base::read_file(csv));
  std::string line;
  std::getline(lines, line);
  std::vector<ShapeRow> rows;
  while (std::getline(lines, line)) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream fields(line);
    ShapeRow row;
    double changed = 0;
    fields >> row.sequence;
    for (int i = 0; i < 3; ++i) fields >> row.direction.centre[i];
    fields >> row.direction.arm >> changed;
    for (int i = 0; i < 6; ++i) fields >> row.direction.twist[i];
    constexpr double kUnobservable = 0.05;  // millimetres of depth for one of motion
    if (changed < kUnobservable) rows.push_back(row);
  }
  return rows;
}

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// The three ways to look at an error.
struct Errors {
  PoseError all, reported, shape;
};

void judge(const std::string& sequence, const std::string& tracker,
           const std::vector<TruthRow>& truth, const std::vector<TrackRow>& track,
           const std::vector<Contact>& contacts, const std::vector<ShapeRow>& shape) {
  const auto moves =
      std::ranges::find_if(truth, [](const auto& row) { return row.phase != "press"; });
  const auto begin = static_cast<std::size_t>(moves - truth.begin()) - 1;
  const std::uint64_t first = truth.front().sequence;
  std::size_t lost = 0;
  std::size_t restarts = 0;
  constexpr PoseError kUnknown{INFINITY, INFINITY};  // no pose was ever told
  Errors end;
  Errors worst;
  std::vector<double> times;
  for (std::size_t i = begin; i < truth.size(); ++i) {
    const TrackRow& row = track.at(i);
    times.push_back(row.frame_us);
    if (i > begin && row.usable && track[i - 1].usable && row.since != track[i - 1].since) {
      ++restarts;
    }
    if (!row.usable) ++lost;
    end = {kUnknown, kUnknown, kUnknown};
    if (row.since == 0) continue;
    const TrackRow& base = track[begin];
    const bool same = base.usable && base.since == row.since;
    const std::size_t from = same ? begin : static_cast<std::size_t>(row.since - first);
    const Eigen::Isometry3d found = same ? row.motion * base.motion.inverse() : row.motion;
    const Eigen::Isometry3d moved = truth[i].pose * truth.at(from).pose.inverse();
    std::vector<Direction> hidden;
    for (const ShapeRow& one : shape) {
      if (one.sequence > row.sequence) break;
      // The object has carried it along since.
      const auto& then = truth.at(static_cast<std::size_t>(one.sequence - first));
      const Eigen::Isometry3d carried = truth[i].pose * then.pose.inverse();
      Direction now = one.direction;
      now.centre = carried * now.centre;
      now.twist.head<3>() = carried.linear() * now.twist.head<3>();
      now.twist.tail<3>() = carried.linear() * now.twist.tail<3>();
      hidden.push_back(now);
    }
    const auto error = [&](const std::vector<Direction>& without) {
      return error_of(found, moved, contacts[i].centre, contacts[i].arm, without);
    };
    end = {error({}), error(row.unobservable), error(hidden)};
    const auto raise = [](PoseError& to, const PoseError& by) {
      to = {std::max(to.mm, by.mm), std::max(to.deg, by.deg)};
    };
    if (!row.usable) continue;
    raise(worst.all, end.all);
    raise(worst.reported, end.reported);
    raise(worst.shape, end.shape);
  }
  const auto pressed_lost =
      std::count_if(track.begin(), track.begin() + static_cast<std::ptrdiff_t>(begin),
                    [](const TrackRow& row) { return row.since != 0 && !row.usable; });
  const auto followed = [&](const PoseError& at_worst) {
    return lost == 0 && restarts == 0 && at_worst.mm <= kFollowedMm && at_worst.deg <= kFollowedDeg
               ? 1
               : 0;
  };
  const auto pair = [](const PoseError& error) {
    return fmt::format("{:.4f},{:.3f}", error.mm, error.deg);
  };
  fmt::print("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{:.0f}\n", sequence, tracker,
             truth.size() - begin, lost, pressed_lost, restarts, followed(worst.reported),
             followed(worst.shape), pair(end.all), pair(end.reported), pair(end.shape),
             pair(worst.all), pair(worst.reported), pair(worst.shape),
             track.back().unobservable.size(), shape.size(), median(times));
  std::fflush(stdout);
}

void judge_all(const fs::path& folder, const std::vector<std::string>& only) {
  fmt::print(
      "sequence,tracker,frames,lost,lost_in_press,restarts,followed_reported,followed_shape,"
      "end_all_mm,end_all_deg,end_reported_mm,end_reported_deg,end_shape_mm,end_shape_deg,"
      "worst_all_mm,worst_all_deg,worst_reported_mm,worst_reported_deg,worst_shape_mm,"
      "worst_shape_deg,reported,shape,median_us\n");
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename();
    const bool wanted = only.empty() || std::ranges::any_of(only, [&](const auto& part) {
                          return name.find(part) != std::string::npos;
                        });
    if (wanted && name.ends_with(".truth.csv")) files.push_back(entry.path());
  }
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    const std::string whole = file.filename();
    const std::string name = whole.substr(0, whole.size() - std::string(".truth.csv").size());
    const auto truth = read_truth(file);
    const auto frames = read_frames(folder / (name + ".frames"));
    const auto shape = read_shape(folder / (name + ".shape.csv"));
    std::vector<Contact> contacts;
    for (const std::string& frame : frames) contacts.push_back(contact_of(frame));
    judge(name, "dtact-perceive", truth, perceive_track(frames), contacts, shape);
    std::vector<fs::path> others;
    for (const auto& entry : fs::directory_iterator(folder)) {
      const std::string other = entry.path().filename();
      if (other.starts_with(name + ".") && other.ends_with(".track.csv")) {
        others.push_back(entry.path());
      }
    }
    std::ranges::sort(others);
    for (const fs::path& other : others) {
      const std::string tracker = other.stem().stem().extension().string().substr(1);
      judge(name, tracker, truth, read_track(other), contacts, shape);
    }
  }
}

}  // namespace
}  // namespace dtact::whole

int main(int argc, char** argv) {
  try {
    CLI::App app("Judges poses on the sequences of a folder against the truth");
    std::string folder;
    std::vector<std::string> only;
    app.add_option("folder", folder, "That pose_sequences wrote")->required();
    app.add_option("--only", only, "Sequences whose name holds this; may be repeated");
    CLI11_PARSE(app, argc, argv);
    dtact::whole::judge_all(folder, only);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "pose_judge: {}\n", e.what());
    return 1;
  }
}
