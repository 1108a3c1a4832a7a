// dtact-calibrate reprocess on a recording as dtactctl writes it.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/stat.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "clients/calibrate/calibrate.hpp"
#include "clients/cpp/maps.hpp"
#include "clients/recording/channels.hpp"
#include "clients/recording/read_recording.hpp"
#include "clients/recording/recording_writer.hpp"
#include "daemon/calibration/calibration.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/base/unique_fd.hpp"
#include "hal/files/mcap_file_sink.hpp"
#include "hal/files/png.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/fakes/toy_sensor.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::reprocess {
namespace {

using testing::Each;
using testing::HasSubstr;
using testing::SizeIs;

/// The ring has grown darker by this share since the reference was taken, and the daemon follows.
constexpr double kFollowed = -0.015;
constexpr std::uint64_t kFrames = 120;

struct Recorded {
  double light = 1 + kFollowed;  ///< Of the frames; the reference has 1.
  bool status = true;
  bool reference = true;
  std::uint64_t starting = 0;              ///< First frames, after which the reference is taken.
  v1::Health early = v1::HEALTH_STARTING;  ///< Health flag of these.
  int decode_scale = 1;                    ///< By what the daemon decoded its JPEGs smaller.
};

class Reprocess : public testing::Test {
 protected:
  Reprocess() { calibration::save(*fakes::toy_calibration(), at("cal")); }

  [[nodiscard]] std::string at(const std::string& name) const {
    return (temp_.path() / name).string();
  }

  /// Frames of the undeformed toy. Status and files follow the first one, as in dtactctl record.
  void record(const std::string& name, const Recorded& recorded = {}) const {
    mcap::FileSink sink(at(name), true);
    recording::RecordingWriter writer(sink, {.program = "test"});
    const auto jpeg = fakes::make_jpeg(
        {.width = fakes::kToyWidth, .height = fakes::kToyHeight, .colour = false},
        [&](int x, int y) {
          return static_cast<int>(std::lround(fakes::toy_grey({.light = recorded.light}, x, y)));
        });
    for (std::uint64_t i = 0; i < kFrames; ++i) {
      v1::Frame frame;
      frame.set_sequence(i);
      frame.set_monotonic_ns(static_cast<std::int64_t>(i + 1) * 16'666'667);
      frame.set_wall_ns(frame.monotonic_ns());
      frame.mutable_jpeg()->set_data(jpeg.data(), jpeg.size());
      if (i < recorded.starting) frame.add_health(recorded.early);
      writer.add(frame);
      if (i == 0) {
        if (recorded.status) writer.add(status());
        writer.attach(recording::kCalibrationToml, "", base::read_file(at("cal/calibration.toml")));
        writer.attach(recording::kReferencePng, "", base::read_file(at("cal/reference.png")));
      }
      // After half of the frames again, as where another calibration was taken meanwhile.
      if (i != recorded.starting && i != kFrames / 2) continue;
      if (i == recorded.starting && i > 0) writer.add(reference_event(frame));
      if (!recorded.reference) continue;
      writer.attach(recording::kCurrentReferencePng, "",
                    image::encode_png(reference(recorded.decode_scale)));
    }
    writer.finish();
  }

  int run(const std::string& from, const std::string& to,
          const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"reprocess", at(from), "--calibration",
                                          at("cal"),   "-o",     at(to)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    std::ostringstream out;
    std::ostringstream error;
    const int code = calibrate::run(arguments, out, error);
    said_ = out.str() + error.str();
    return code;
  }

  struct Read {
    std::vector<double> off_um;  ///< Each frame's median distance from zero.
    std::vector<v1::Status> statuses;
  };
  [[nodiscard]] Read read(const std::string& name) const {
    Read all;
    recording::RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
      EXPECT_FALSE(frame.contact().in_contact());
      if (!frame.has_depth()) return true;
      std::vector<std::int16_t> um = client::values_of(frame.depth());
      std::ranges::nth_element(um, um.begin() + static_cast<std::ptrdiff_t>(um.size() / 2));
      all.off_um.push_back(std::abs(um[um.size() / 2]));
      return true;
    };
    handlers.status = [&](const v1::Status& status, std::uint64_t) {
      all.statuses.push_back(status);
      return true;
    };
    recording::read_recording(mcap::Reader(at(name)), handlers);
    return all;
  }

  /// That b.mcap, made of a.mcap, and c.mcap, made of b.mcap, hold `maps` maps of zero depth, and
  /// one status with this light.
  void expect_zero(std::size_t maps, double followed) {
    ASSERT_EQ(run("b.mcap", "c.mcap"), 0) << said_;
    for (const char* name : {"b.mcap", "c.mcap"}) {
      const Read made = read(name);
      EXPECT_THAT(made.off_um, SizeIs(maps)) << name;
      EXPECT_THAT(made.off_um, Each(testing::Lt(10))) << name;
      ASSERT_THAT(made.statuses, SizeIs(1)) << name;
      EXPECT_EQ(made.statuses[0].light_followed(), followed) << name;
      EXPECT_FALSE(made.statuses[0].has_calibration()) << name;
    }
  }

  std::string said_;

 private:
  /// The toy's reference in frames that are smaller by `scale`.
  static image::Grey16 reference(int scale) {
    const std::vector<std::uint16_t> fine = fakes::toy_reference_q8();
    image::Grey16 image{fakes::kToyWidth / scale, fakes::kToyHeight / scale, {}};
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        int sum = 0;
        for (int i = 0; i < scale * scale; ++i) {
          sum += fine[static_cast<std::size_t>((scale * y + i / scale) * fakes::kToyWidth +
                                               scale * x + i % scale)];
        }
        image.pixels.push_back(static_cast<std::uint16_t>(sum / (scale * scale)));
      }
    }
    return image;
  }
  static v1::Status status() {
    v1::Status status;
    status.set_light_followed(kFollowed);
    status.mutable_calibration()->set_name("toy");
    return status;
  }
  static v1::Event reference_event(const v1::Frame& frame) {
    v1::Event event;
    event.set_sequence(frame.sequence());
    event.set_monotonic_ns(frame.monotonic_ns());
    event.set_wall_ns(frame.wall_ns());
    event.mutable_reference()->set_sequence(frame.sequence());
    return event;
  }

  calibration::TempFolder temp_;
};

// Without the factor, depth is 70 µm too deep.
TEST_F(Reprocess, UsesTheLightThatTheDaemonFollowed) {
  record("a.mcap");
  ASSERT_EQ(run("a.mcap", "b.mcap"), 0) << said_;
  expect_zero(kFrames, kFollowed);
}

// The recording began while the daemon took another reference.
TEST_F(Reprocess, AReferenceTakenAfterTheStatusHasItsOwnLight) {
  record("a.mcap", {.light = 1, .starting = 10});
  ASSERT_EQ(run("a.mcap", "b.mcap"), 0) << said_;
  expect_zero(kFrames - 10, 0);
}

TEST_F(Reprocess, AReferenceMadeOfTheFramesHasTheirLight) {
  record("a.mcap", {.reference = false});
  ASSERT_EQ(run("a.mcap", "b.mcap", {"--reference-frames", "16"}), 0) << said_;
  expect_zero(kFrames, 0);
}

TEST_F(Reprocess, ARecordingWithoutAStatusHasTheLightOfItsReference) {
  record("a.mcap", {.light = 1, .status = false});
  ASSERT_EQ(run("a.mcap", "b.mcap"), 0) << said_;
  const Read made = read("b.mcap");
  EXPECT_THAT(made.off_um, SizeIs(kFrames));
  EXPECT_THAT(made.off_um, Each(testing::Lt(10)));
  EXPECT_THAT(made.statuses, SizeIs(0));
}

// What the daemon did not measure is not measured, either.
TEST_F(Reprocess, MakesNoDepthWhileTheReferenceDoesNotHold) {
  for (const v1::Health flag : {v1::HEALTH_LIGHT_UNSETTLED, v1::HEALTH_REFERENCE_STALE}) {
    record("a.mcap", {.light = 1, .starting = 10, .early = flag});
    ASSERT_EQ(run("a.mcap", "b.mcap", {"--force"}), 0) << said_;
    EXPECT_THAT(read("b.mcap").off_um, SizeIs(kFrames - 10)) << v1::Health_Name(flag);
    EXPECT_THAT(said_, HasSubstr("120 frames, depth made anew in 110"));
  }
}

// The calibration is of whole frames, and the recording holds the JPEGs as the camera gave them.
TEST_F(Reprocess, DecodesAsSmallAsTheDaemonDid) {
  for (const int scale : {2, 4}) {
    record("a.mcap", {.decode_scale = scale});
    ASSERT_EQ(run("a.mcap", "b.mcap", {"--force"}), 0) << scale << ": " << said_;
    const Read made = read("b.mcap");
    EXPECT_THAT(made.off_um, SizeIs(kFrames)) << scale;
    EXPECT_THAT(made.off_um, Each(testing::Lt(10))) << scale;
  }
}

// The part is a pipe, which the program waits to open until the signal has come.
TEST_F(Reprocess, CtrlCLeavesNoPart) {
  record("a.mcap");
  const std::string part = at("b.mcap.part");
  ASSERT_EQ(::mkfifo(part.c_str(), 0600), 0);
  // Shells start background jobs with it ignored.
  const auto before = std::signal(SIGINT, SIG_DFL);
  base::UniqueFd pipe;
  std::thread user([&pipe, &part, program = ::pthread_self()] {
    struct sigaction now{};
    const auto handled = [&now] {
      return ::sigaction(SIGINT, nullptr, &now) == 0 && now.sa_handler != SIG_DFL;
    };
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!handled() && std::chrono::steady_clock::now() < end) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    if (handled()) ::pthread_kill(program, SIGINT);
    pipe = base::UniqueFd(::open(part.c_str(), O_RDWR | O_CLOEXEC));
    // All that the program may write, since nobody reads it.
    (void)::fcntl(pipe.get(), F_SETPIPE_SZ, 1 << 20);
  });
  EXPECT_EQ(run("a.mcap", "b.mcap"), 1);
  user.join();
  (void)std::signal(SIGINT, before);
  EXPECT_THAT(said_, HasSubstr("interrupted: nothing was written"));
  EXPECT_FALSE(std::filesystem::exists(part));
  EXPECT_FALSE(std::filesystem::exists(at("b.mcap")));
}

}  // namespace
}  // namespace dtact::reprocess
