// Judges poses against the truth in the files of pose_sequences: dtact-perceive's, computed here,
// and those of other trackers in files SEQUENCE.TRACKER.track.csv beside the frames
// (open3d_icp.py). Prints a line of CSV for each sequence and tracker. Errors are of the motion
// from the last frame before the object moves (with --known of the object's pose) at the contact's
// centre: `all`, `reported` without the directions that the tracker reports as unobservable,
// `shape` without those that change no depth (SEQUENCE.shape.csv).
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "clients/perceive/frame_maker.hpp"
#include "clients/perceive/object_file.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/sim/scene.hpp"
#include "proto/dtact.pb.h"
#include "tests/accuracy/whole/known_object.hpp"
#include "tests/accuracy/whole/moving_objects.hpp"
#include "tests/accuracy/whole/pose_track.hpp"
#include "tests/accuracy/whole/sequence.hpp"

namespace dtact::whole {
namespace {

namespace fs = std::filesystem;

/// A sequence counts as followed when all its frames are within these.
constexpr double kFollowedMm = 0.3;
constexpr double kFollowedDeg = 5;

constexpr std::array kWays{"all", "reported", "shape"};

std::array<PoseError, kWays.size()> listed(const PoseErrors& errors) {
  return {errors.all, errors.reported, errors.shape};
}

/// `part` of 1 is the greatest. NaN without values.
double part_of(std::vector<double> values, double part) {
  if (values.empty()) return NAN;
  const auto at = values.begin() + std::lround(part * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

void print_head(bool each_frame) {
  std::string head = "sequence,tracker,";
  head += each_frame ? "frame,usable,since,reported"
                     : "frames,lost,lost_in_press,restarts,followed_reported,followed_shape,"
                       "reported,shape,frame_us";
  const std::vector<std::string> when = each_frame
                                            ? std::vector<std::string>{""}
                                            : std::vector<std::string>{"end_", "median_", "worst_"};
  for (const std::string& one : when) {
    for (const char* way : kWays) head += fmt::format(",{0}{1}_mm,{0}{1}_deg", one, way);
  }
  fmt::print("{}\n", head);
}

/// The first frame of the motion without contact, or the number of frames: an object that rolls on
/// a curved surface may leave it, and then cannot be followed.
std::size_t contact_end(const Sequence& sequence) {
  std::size_t at = sequence.begin();
  for (v1::Frame frame; at < sequence.frames.size(); ++at) {
    frame.ParseFromString(sequence.frames[at]);
    if (!frame.contact().in_contact()) break;
  }
  return at;
}

/// A line for each frame of the motion.
void print_frames(const Sequence& sequence, const std::string& tracker,
                  const std::vector<TrackRow>& track,
                  const std::function<PoseErrors(const TrackRow&)>& errors_of) {
  for (const TrackRow& row : track) {
    if (sequence.index(row.sequence) < sequence.begin() || !row.has_pose) continue;
    std::string line = fmt::format("{},{},{},{},{},{}", sequence.name, tracker, row.sequence,
                                   row.usable ? 1 : 0, row.since, row.unobservable.size());
    for (const PoseError& error : listed(errors_of(row))) {
      line += fmt::format(",{:.4f},{:.3f}", error.mm, error.deg);
    }
    fmt::print("{}\n", line);
  }
}

std::size_t unobservable_at_end(const Sequence& sequence) {
  return static_cast<std::size_t>(std::ranges::count_if(sequence.shape, [&](const ShapeRow& row) {
    return row.sequence == sequence.shape.back().sequence && row.shown < ShapeRow::kMinShown;
  }));
}

void print_row(const Sequence& sequence, const std::string& tracker,
               const std::vector<TrackRow>& track,
               const std::function<PoseErrors(const TrackRow&)>& errors_of) {
  int lost = 0;
  int lost_in_press = 0;
  int restarts = 0;
  const TrackRow* before = nullptr;
  const std::size_t contact_ends = contact_end(sequence);
  std::vector<double> times;
  std::array<PoseError, kWays.size()> end;
  std::array<std::vector<double>, kWays.size()> mm;
  std::array<std::vector<double>, kWays.size()> deg;
  for (const TrackRow& row : track) {
    if (sequence.index(row.sequence) < sequence.begin()) {
      lost_in_press += row.has_pose && !row.usable ? 1 : 0;
      continue;
    }
    if (sequence.index(row.sequence) >= contact_ends) break;
    times.push_back(row.frame_us);
    lost += row.usable ? 0 : 1;
    restarts += before != nullptr && row.usable && before->usable && row.since != before->since;
    before = &row;
    end.fill({INFINITY, INFINITY});  // as long as no pose was reported
    if (!row.has_pose) continue;
    end = listed(errors_of(row));
    for (std::size_t way = 0; row.usable && way < kWays.size(); ++way) {
      mm.at(way).push_back(end.at(way).mm);
      deg.at(way).push_back(end.at(way).deg);
    }
  }
  const auto followed = [&](std::size_t way) {
    return lost == 0 && restarts == 0 && part_of(mm.at(way), 1) <= kFollowedMm &&
                   part_of(deg.at(way), 1) <= kFollowedDeg
               ? 1
               : 0;
  };
  std::string line = fmt::format("{},{},{},{},{},{},{},{},{},{},{:.0f}", sequence.name, tracker,
                                 times.size(), lost, lost_in_press, restarts, followed(1),
                                 followed(2), track.back().unobservable.size(),
                                 unobservable_at_end(sequence), part_of(times, 0.5));
  for (const PoseError& error : end) line += fmt::format(",{:.4f},{:.3f}", error.mm, error.deg);
  for (const double part : {0.5, 1.0}) {
    for (std::size_t way = 0; way < kWays.size(); ++way) {
      line += fmt::format(",{:.4f},{:.3f}", part_of(mm.at(way), part), part_of(deg.at(way), part));
    }
  }
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void judge_motion(const fs::path& folder, const Sequence& sequence, bool each_frame) {
  perceive::FrameMaker maker;
  const auto judge = [&](const std::string& tracker, const std::vector<TrackRow>& track) {
    (each_frame ? print_frames : print_row)(sequence, tracker, track, [&](const TrackRow& row) {
      return motion_errors(sequence, track, row);
    });
  };
  judge("dtact-perceive", perceive_track(sequence.frames, maker));
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

/// The object's shape comes from a file, like a user's.
void judge_known(const fs::path& folder, const Sequence& sequence, bool each_frame) {
  constexpr double kFps = 60;
  const std::string name = sequence.name.substr(0, sequence.name.find('.'));
  const auto* const object = std::ranges::find(kMovingObjects, name, &MovingObject::name);
  if (object == kMovingObjects.end()) return;
  const hal::sim::Scene scene = hal::sim::parse_scene(
      fmt::format("[[press]]\n{}\nkeys = [{{ t = 0.0 }}]\n", object->lines), name);
  const ObjectCloud cloud = cloud_of(scene.presses.at(0).object);
  const auto judge = [&](const std::string& tracker, const fs::path& file, const std::string& shape,
                         const std::vector<Eigen::Isometry3d>& symmetries) {
    base::write_file_atomically(file, shape);
    perceive::FrameMaker maker(perceive::load_object(file, "mm"));
    const auto track = perceive_track(sequence.frames, maker, kFps);
    (each_frame ? print_frames : print_row)(sequence, tracker, track, [&](const TrackRow& row) {
      return place_errors(sequence, row, symmetries);
    });
  };
  judge("cloud", folder / (name + ".ply"), ply_of(cloud), symmetries_of(cloud));
  if (name == "cube") judge("mesh", folder / (name + ".stl"), cube_stl(5), cube_symmetries(5));
}

struct Arguments {
  fs::path folder;
  std::vector<std::string> only;
  bool known = false;
  bool each_frame = false;
};

void judge_all(const Arguments& arguments) {
  const auto& [folder, only, known, each_frame] = arguments;
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
  print_head(each_frame);
  for (const std::string& name : names) {
    const Sequence sequence = load(folder, name);
    (known ? judge_known : judge_motion)(folder, sequence, each_frame);
  }
}

}  // namespace
}  // namespace dtact::whole

int main(int argc, char** argv) {
  try {
    CLI::App app("Judges poses on the sequences of a folder against the truth");
    dtact::whole::Arguments arguments;
    app.add_option("folder", arguments.folder, "That pose_sequences wrote")->required();
    app.add_option("--only", arguments.only, "Sequences whose name holds this; may be repeated");
    app.add_flag("--known", arguments.known,
                 "The object's shape is known: its place, in real time");
    app.add_flag("--each-frame", arguments.each_frame, "A line for each frame of the motion");
    CLI11_PARSE(app, argc, argv);
    dtact::whole::judge_all(arguments);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "pose_judge: {}\n", e.what());
    return 1;
  }
}
