#include "tests/accuracy/whole/sequence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string_view>

#include "hal/base/atomic_file.hpp"
#include "proto/framing.hpp"
#include "tests/accuracy/whole/program.hpp"
#include "tests/accuracy/whole/shape.hpp"

namespace dtact::whole {
namespace {

namespace fs = std::filesystem;

/// Limit for a minute's maps.
constexpr std::size_t kMaxBytes = std::size_t{4} << 30U;

const char* phase_of(const MotionFrames& frames, std::uint64_t n) {
  if (n <= frames.motion) return "press";
  return n < frames.end ? "motion" : "end";
}

std::vector<std::string> read_frames(const fs::path& file) {
  const std::string bytes = base::read_file(file, kMaxBytes);
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

}  // namespace

std::size_t Sequence::begin() const {
  const auto moves =
      std::ranges::find_if(truth, [](const TruthRow& row) { return row.phase != "press"; });
  return static_cast<std::size_t>(moves - truth.begin()) - 1;
}

std::size_t Sequence::index(std::uint64_t sequence) const {
  return static_cast<std::size_t>(sequence - truth.front().sequence);
}

Eigen::Isometry3d Sequence::motion(std::size_t from, std::size_t to) const {
  return truth.at(to).pose * truth.at(from).pose.inverse();
}

std::vector<Direction> Sequence::unobservable(std::size_t at) const {
  std::vector<Direction> now;
  for (const ShapeRow& row : shape) {
    if (row.sequence > truth.at(at).sequence) break;
    if (row.shown >= ShapeRow::kMinShown) continue;
    now.push_back(carried(row.direction, motion(index(row.sequence), at)));
  }
  return now;
}

std::vector<ShapeRow> shape_of(const hal::sim::Scene& scene, const MotionFrames& frames) {
  constexpr std::uint64_t kParts = 4;
  std::vector<ShapeRow> rows;
  for (std::uint64_t part = 0; part <= kParts; ++part) {
    const std::uint64_t n = frames.motion + (frames.end - frames.motion) * part / kParts;
    for (const ShownDirection& one : shown_directions(scene, n)) {
      rows.push_back({n, one.direction, one.shown});
    }
  }
  return rows;
}

void record(const std::shared_ptr<const hal::sim::Truth>& truth, const fs::path& calibration,
            const MovingObject& object, std::span<const ObjectMotion> motions,
            std::span<const MotionFrames> choreography,
            std::span<const std::vector<ShapeRow>> shapes,
            const std::function<void(const Sequence&)>& done) {
  Program program(truth, calibration);
  const Eigen::Isometry3d map_from_scene = map_frame(truth->scene(), calibration).from_scene;
  std::uint64_t n = 0;
  for (std::size_t i = 0; i < motions.size(); ++i) {
    const MotionFrames& frames = choreography[i];
    for (; n < frames.first; ++n) (void)program.next();
    Sequence sequence;
    sequence.name = fmt::format("{}.{}", object.name, motions[i].name);
    for (; n <= frames.last; ++n) {
      sequence.frames.push_back(program.next());
      sequence.truth.push_back({n, truth->force_n(n) > 0,
                                map_from_scene * isometry_of(truth->pose(0, n).value()),
                                phase_of(frames, n)});
    }
    for (const ShapeRow& row : shapes[i]) {
      sequence.shape.push_back({row.sequence, carried(row.direction, map_from_scene), row.shown});
    }
    done(sequence);
  }
}

void save(const Sequence& sequence, const fs::path& folder) {
  fs::create_directories(folder);
  const fs::path file = folder / (sequence.name + ".frames");
  std::ofstream written(file, std::ios::binary);
  for (const std::string& frame : sequence.frames) {
    const auto length = wire::encode_length(frame.size());
    written.write(reinterpret_cast<const char*>(length.data()), std::ssize(length));
    written.write(frame.data(), std::ssize(frame));
  }
  if (!written.flush()) throw std::runtime_error(fmt::format("cannot write {}", file.string()));
  std::string csv =
      "sequence,x_mm,y_mm,z_mm,arm_mm,shown,turn_x,turn_y,turn_z,shift_x,shift_y,shift_z\n";
  for (const ShapeRow& row : sequence.shape) {
    csv += fmt::format("{}", row.sequence);
    for (const double value : row.direction.centre) csv += fmt::format(",{:.4f}", value);
    csv += fmt::format(",{:.4f},{:.5f}", row.direction.arm, row.shown);
    for (const double value : row.direction.twist) csv += fmt::format(",{:.6f}", value);
    csv += '\n';
  }
  base::write_file_atomically(folder / (sequence.name + ".shape.csv"), csv);
  csv = "sequence,in_contact,r11,r12,r13,r21,r22,r23,r31,r32,r33,x_mm,y_mm,z_mm,phase\n";
  for (const TruthRow& row : sequence.truth) {
    csv += fmt::format("{},{}", row.sequence, row.in_contact ? 1 : 0);
    for (int i = 0; i < 9; ++i) csv += fmt::format(",{:.12g}", row.pose.linear()(i / 3, i % 3));
    for (const double value : row.pose.translation()) csv += fmt::format(",{:.9g}", value);
    csv += fmt::format(",{}\n", row.phase);
  }
  base::write_file_atomically(folder / (sequence.name + ".truth.csv"), csv);
}

Sequence load(const fs::path& folder, const std::string& name) {
  Sequence sequence;
  sequence.name = name;
  for_each_line(folder / (name + ".truth.csv"), [&](std::istream& fields) {
    TruthRow& row = sequence.truth.emplace_back();
    fields >> row.sequence >> row.in_contact;
    read_pose(fields, row.pose);
    fields >> row.phase;
  });
  sequence.frames = read_frames(folder / (name + ".frames"));
  const fs::path shape = folder / (name + ".shape.csv");
  if (!fs::exists(shape)) return sequence;
  for_each_line(shape, [&](std::istream& fields) {
    ShapeRow& row = sequence.shape.emplace_back();
    fields >> row.sequence;
    for (double& value : row.direction.centre) fields >> value;
    fields >> row.direction.arm >> row.shown;
    for (double& value : row.direction.twist) fields >> value;
  });
  return sequence;
}

void for_each_line(const fs::path& csv, const std::function<void(std::istream&)>& read) {
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

}  // namespace dtact::whole
