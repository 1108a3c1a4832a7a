// dtactctl record, export and reprocess on the simulated sensor.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <thread>

#include "clients/cpp/maps.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/read_recording.hpp"
#include "hal/base/atomic_file.hpp"
#include "tests/e2e/patience.hpp"
#include "tests/e2e/sensor.hpp"

extern char** environ;

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Record : public testing::Test {
 protected:
  explicit Record(const std::vector<std::string>& settings = {}) : sensor({}, true, settings) {}

  /// Records, makes the depth anew with the same calibration and compares.
  void make_the_same_depth_anew() const;
  [[nodiscard]] std::vector<std::string> command(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all = {
        DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port()),
        "record",         "-o",     file.string()};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  [[nodiscard]] static pid_t start(const std::vector<std::string>& arguments) {
    std::vector<char*> argv;
    for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    pid_t pid = -1;
    EXPECT_EQ(::posix_spawn(&pid, argv[0], nullptr, nullptr, argv.data(), environ), 0);
    return pid;
  }
  [[nodiscard]] static int end(pid_t pid, int signal) {
    ::kill(pid, signal);
    int status = 0;
    ::waitpid(pid, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  /// Waits until chunks have been written.
  void wait_for_bytes(std::uintmax_t bytes) const {
    std::error_code missing;
    for (int i = 0; i < 600; ++i) {
      if (const auto size = fs::file_size(file, missing); !missing && size > bytes) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
    FAIL() << "the recording does not grow";
  }
  [[nodiscard]] static std::map<std::uint64_t, v1::Frame> frames_of(const mcap::Reader& reader) {
    std::map<std::uint64_t, v1::Frame> frames;
    recording::RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
      frames[frame.sequence()] = frame;
      return true;
    };
    recording::read_recording(reader, handlers);
    return frames;
  }

  Sensor sensor;
  TempFolder folder;
  fs::path file = folder.path() / "press.mcap";
};

TEST_F(Record, SigtermFinishesTheFile) {
  const pid_t pid = start(command());
  wait_for_bytes(3'000'000);
  EXPECT_EQ(end(pid, SIGTERM), 0);
  const mcap::Reader reader(file);
  EXPECT_EQ(reader.damage(), "");
  const auto frames = frames_of(reader);
  ASSERT_FALSE(frames.empty());
  const auto with_depth =
      std::ranges::find_if(frames, [](const auto& entry) { return entry.second.has_depth(); });
  ASSERT_NE(with_depth, frames.end());
  const v1::Frame& frame = with_depth->second;
  EXPECT_EQ(client::values_of(frame.depth()).size(), std::size_t{kCropWidth} * kCropHeight);
  // The simulated camera delivers JPEG.
  EXPECT_EQ(frame.jpeg().data().substr(0, 2), "\xff\xd8");
  const auto attached = [&](const char* name) {
    const auto place = recording::find_attachment(reader, name);
    return place ? reader.attachment(*place).data : "";
  };
  EXPECT_EQ(attached("calibration.toml"),
            base::read_file(calibration_folder() / "calibration.toml"));
  EXPECT_EQ(attached("reference.png"), base::read_file(calibration_folder() / "reference.png"));
  EXPECT_EQ(attached("current_reference.png").substr(0, 4), "\x89PNG");
  int statuses = 0;
  recording::RecordingHandlers handlers;
  handlers.status = [&](const v1::Status& status, std::uint64_t) {
    ++statuses;
    EXPECT_EQ(status.camera().backend(), "sim");
    return true;
  };
  recording::read_recording(reader, handlers);
  EXPECT_EQ(statuses, 1);
}

TEST_F(Record, AClosedTerminalFinishesTheFile) {
  const pid_t pid = start(command());
  wait_for_bytes(1'000'000);
  EXPECT_EQ(end(pid, SIGHUP), 0);
  const mcap::Reader reader(file);
  EXPECT_EQ(reader.damage(), "");
  EXPECT_FALSE(frames_of(reader).empty());
}

TEST_F(Record, NohupGoesOnWithoutATerminal) {
  const auto recorder = command({"--seconds", std::to_string(kSlower)});
  std::vector<std::string> arguments = {"/usr/bin/nohup"};
  arguments.insert(arguments.end(), recorder.begin(), recorder.end());
  const auto began = std::chrono::steady_clock::now();
  const pid_t pid = start(arguments);
  wait_for_bytes(100);
  EXPECT_EQ(end(pid, SIGHUP), 0);
  EXPECT_GE(std::chrono::steady_clock::now() - began, std::chrono::seconds(kSlower));
}

TEST_F(Record, SigkillLosesTheOpenChunkOnly) {
  const pid_t pid = start(command());
  wait_for_bytes(3'000'000);
  EXPECT_EQ(end(pid, SIGKILL), 128 + SIGKILL);
  const mcap::Reader reader(file);
  EXPECT_THAT(reader.damage(), HasSubstr("byte "));
  EXPECT_GE(frames_of(reader).size(), 5U);
  std::string said;
  EXPECT_EQ(
      run_program({DTACTCTL_PROGRAM, "export", file, "--to", "csv", "-o", folder.path() / "out"},
                  &said),
      0)
      << said;
  EXPECT_THAT(said, HasSubstr("parts of the recording could not be read"));
}

TEST_F(Record, AFullDiskEndsTheRecordingAndNotTheDaemon) {
  // A limit of 3 MB on the file plays a full disk.
  std::vector<std::string> limited = {"/bin/bash", "-c", "ulimit -f 3000; exec \"$0\" \"$@\""};
  const auto recorder = command();
  limited.insert(limited.end(), recorder.begin(), recorder.end());
  std::string said;
  EXPECT_EQ(run_program(limited, &said), 1);
  EXPECT_THAT(said, HasSubstr("the recording ended early: " + file.string() + ": File too large"));
  EXPECT_LE(fs::file_size(file), 3000U * 1024);
  // Whether the index still fitted is chance; the written chunks are readable.
  EXPECT_FALSE(mcap::Reader(file).attachments().empty());
  EXPECT_NO_THROW((void)frames_of(mcap::Reader(file)));
  client::Client client = sensor.connect();
  const auto before = client.status().frames();
  client.subscribe();
  EXPECT_TRUE(
      read_until(client, [](const Item& i) { return std::holds_alternative<v1::Frame>(i); }));
  EXPECT_GT(client.status().frames(), before);
}

TEST_F(Record, AFileIsNotReplacedUnasked) {
  base::write_file_atomically(file, "mine");
  std::string said;
  EXPECT_EQ(run_program(command({"--seconds", "1"}), &said), 1);
  EXPECT_THAT(said, HasSubstr("add --force"));
  EXPECT_EQ(base::read_file(file), "mine");
  EXPECT_EQ(
      run_program(command({"--seconds", std::to_string(kSlower), "--force", "--progress"}), &said),
      0)
      << said;
  EXPECT_EQ(mcap::Reader(file).damage(), "");
  EXPECT_THAT(said, HasSubstr(" frames in "));
}

TEST_F(Record, WithoutAFrameLeavesTheFileAsItWas) {
  // Over before the first frame is asked for.
  const std::string none = "0.0001";
  std::string said;
  EXPECT_EQ(run_program(command({"--seconds", none}), &said), 1);
  EXPECT_THAT(said, HasSubstr("no frame came"));
  EXPECT_FALSE(fs::exists(file));
  base::write_file_atomically(file, "an earlier one");
  EXPECT_EQ(run_program(command({"--seconds", none, "--force"}), &said), 1);
  EXPECT_EQ(base::read_file(file), "an earlier one");
  EXPECT_FALSE(fs::exists(file.string() + ".part"));
}

/// With a daemon that decodes at half the size.
class RecordAtHalf : public Record {
 protected:
  RecordAtHalf() : Record({"camera.decode_scale=2"}) {}
};

// The same calibration, the recorded JPEGs and the recorded reference give the recorded depth, bit
// for bit, except at the edge of activity: the daemon's state before the recording (noise,
// hysteresis) is not in it, and a tile that only one of the two computed is 0 in the other.
TEST_F(Record, TheSameCalibrationMakesTheSameDepthAnew) { make_the_same_depth_anew(); }
TEST_F(RecordAtHalf, TheSameCalibrationMakesTheSameDepthAnew) { make_the_same_depth_anew(); }

void Record::make_the_same_depth_anew() const {
  std::string said;
  ASSERT_EQ(run_program(command({"--seconds", "5"}), &said), 0) << said;
  const fs::path anew = folder.path() / "anew.mcap";
  ASSERT_EQ(run_program({CALIBRATE_PROGRAM, "reprocess", file, "--calibration",
                         calibration_folder().string(), "-o", anew},
                        &said),
            0)
      << said;
  const auto recorded = frames_of(mcap::Reader(file));
  const mcap::Reader reader(anew);
  EXPECT_EQ(reader.damage(), "");
  const auto remade = frames_of(reader);
  ASSERT_EQ(recorded.size(), remade.size());
  std::size_t pixels = 0;
  std::size_t equal = 0;
  std::size_t made = 0;  // in both
  std::size_t made_equal = 0;
  int worst = 0;
  std::vector<double> apart;  // in stated uncertainties
  for (const auto& [sequence, frame] : recorded) {
    const v1::Frame& other = remade.at(sequence);
    ASSERT_EQ(frame.has_depth(), other.has_depth()) << sequence;
    EXPECT_EQ(frame.jpeg().data(), other.jpeg().data());
    if (!frame.has_depth()) continue;
    apart.push_back(other.depth().uncertainty_um() / frame.depth().uncertainty_um());
    const auto was = client::values_of(frame.depth());
    const auto is = client::values_of(other.depth());
    EXPECT_EQ(frame.depth().decimation(), other.depth().decimation());
    ASSERT_EQ(was.size(), is.size());
    pixels += was.size();
    for (std::size_t i = 0; i < was.size(); ++i) {
      equal += was[i] == is[i] ? 1U : 0U;
      if (was[i] != 0 && is[i] != 0) {
        ++made;
        made_equal += was[i] == is[i] ? 1U : 0U;
      }
      worst = std::max(worst, std::abs(was[i] - is[i]));
    }
  }
  ASSERT_GT(pixels, 0U);
  const auto percent = [](std::size_t part, std::size_t of) {
    return 100 * static_cast<double>(part) / static_cast<double>(of);
  };
  std::printf(
      "%zu frames: %.3f %% of all pixels equal, %.3f %% of those made in both, the worst "
      "%d um off\n",
      recorded.size(), percent(equal, pixels), percent(made_equal, made), worst);
  EXPECT_GE(percent(equal, pixels), 97);
  EXPECT_GE(percent(made_equal, made), 99);
  EXPECT_LE(worst, 60);
  const auto [least, most] = std::ranges::minmax(apart);
  std::printf("stated uncertainty: %.3f to %.3f of the recorded\n", least, most);
  EXPECT_GE(least, 0.9);
  EXPECT_LE(most, 1.1);
}

TEST_F(Record, WithoutJpegsDepthCannotBeMadeAnew) {
  // A recording has the reference image where there is one when it begins.
  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(read_until(client, [](const Item& i) {
    const auto* frame = std::get_if<v1::Frame>(&i);
    return frame != nullptr && frame->has_depth();
  }));
  std::string said;
  ASSERT_EQ(run_program(command({"--seconds", std::to_string(2 * kSlower), "--no-jpeg",
                                 "--pictures-hz", "0"}),
                        &said),
            0)
      << said;
  const mcap::Reader reader(file);
  for (const auto& [id, channel] : reader.channels()) {
    EXPECT_NE(channel.topic, "/camera/jpeg");
    EXPECT_NE(channel.topic, "/dtact/depth");
  }
  EXPECT_EQ(run_program({CALIBRATE_PROGRAM, "reprocess", file, "--calibration",
                         calibration_folder().string(), "-o", folder.path() / "anew.mcap"},
                        &said),
            1);
  EXPECT_THAT(said, HasSubstr("no frame of it holds a JPEG"));
}

// The frames were recorded without a calibration; this scene has no contact.
TEST(RecordUncalibrated, GetsItsDepthFromFramesThatWereWithoutContact) {
  const Sensor sensor(scene_file("nothing.toml"), false);
  const TempFolder folder;
  const std::string file = folder.path() / "a.mcap";
  const std::string anew = folder.path() / "b.mcap";
  std::string said;
  ASSERT_EQ(run_program({DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port()),
                         "record", "-o", file, "--seconds", "3"},
                        &said),
            0)
      << said;
  const std::vector<std::string> reprocess = {CALIBRATE_PROGRAM,
                                              "reprocess",
                                              file,
                                              "--calibration",
                                              calibration_folder().string(),
                                              "-o",
                                              anew};
  EXPECT_EQ(run_program(reprocess, &said), 1);
  EXPECT_THAT(said, HasSubstr("say so by --reference-frames 32"));
  base::write_file_atomically(anew, "an earlier one");
  auto with = reprocess;
  with.emplace_back("--force");
  EXPECT_EQ(run_program(with, &said), 1);
  EXPECT_EQ(base::read_file(anew), "an earlier one");
  with = reprocess;
  with.insert(with.end(), {"--reference-frames", "16", "--force"});
  ASSERT_EQ(run_program(with, &said), 0) << said;
  const mcap::Reader reader(anew);
  std::size_t maps = 0;
  recording::RecordingHandlers handlers;
  handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
    if (!frame.has_depth()) return true;
    ++maps;
    EXPECT_FALSE(frame.contact().in_contact());
    EXPECT_FALSE(has(frame.health(), v1::HEALTH_UNCALIBRATED));
    return true;
  };
  recording::read_recording(reader, handlers);
  EXPECT_GE(maps, 16U);
}

}  // namespace
}  // namespace dtact::e2e
