// dtactctl snapshot and dtactctl watch, which read frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "tests/unit/ctl/run_ctl.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using net::test::make_frame;
using net::test::Rig;
using test::ctl;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

/// Publishes frames until its end.
class Stream {
 public:
  explicit Stream(Rig& rig)
      : thread_([this, &rig] {
          for (std::uint64_t sequence = 1; !end_; ++sequence) {
            rig.port.publish(make_frame(sequence));
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
          }
        }) {}
  ~Stream() {
    end_ = true;
    thread_.join();
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

 private:
  std::atomic<bool> end_ = false;
  std::thread thread_;
};

TEST(Snapshot, SavesDepthAndLuma) {
  Rig rig;
  const Stream stream(rig);
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path folder = ::mkdtemp(name.data());
  const std::vector<std::pair<std::string, std::string>> files = {
      {"depth.npy", "\x93NUMPY"}, {"depth.png", "\x89PNG"}, {"depth.ply", "ply\n"}};
  for (const auto& [file, begin] : files) {
    const std::string path = (folder / file).string();
    const auto result = ctl(rig, {"snapshot", "-o", path, "--timeout", "60"});
    EXPECT_EQ(result.code, 0) << result.error;
    EXPECT_THAT(result.out, StartsWith(path + ": frame "));
    EXPECT_THAT(base::read_file(path), StartsWith(begin));
  }
  const std::string path = (folder / "luma.png").string();
  const auto result = ctl(rig, {"snapshot", "--luma", "-o", path, "--timeout", "60", "--json"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out, StartsWith("{\"file\":\"" + path + "\",\"frame\":{\"sequence\":"));
  EXPECT_EQ(image::read_png_grey8(path).width, 8);
  fs::remove_all(folder);
}

TEST(Snapshot, WantsAFormatItKnows) {
  EXPECT_EQ(ctl({"snapshot", "-o", "depth.tiff"}).code, 2);
  EXPECT_EQ(ctl({"snapshot", "--luma", "-o", "luma.npy"}).code, 2);
  EXPECT_EQ(ctl({"snapshot"}).code, 2);
}

TEST(Snapshot, SaysWhyNothingCame) {
  Rig rig;
  pipeline::Status status;
  status.state = pipeline::State::uncalibrated;
  status.health.set(pipeline::Health::uncalibrated);
  rig.port.set_status(status);
  const auto result = ctl(rig, {"snapshot", "-o", "depth.npy", "--timeout", "0.05"});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error,
              AllOf(HasSubstr("no depth came within 0.05 s"), HasSubstr("calibrate depth")));
}

TEST(Watch, PrintsLinesAndASummary) {
  Rig rig;
  const Stream stream(rig);
  const auto result = ctl(rig, {"watch", "--seconds", "1.5", "--min-fps", "0.5"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out, AllOf(HasSubstr(" fps  contact "), HasSubstr("latency p50"),
                                HasSubstr("\nwatched 1.5 s: "), HasSubstr(" ms since arrival; "),
                                HasSubstr("health flags: none\n")));
}

TEST(Watch, PrintsJson) {
  Rig rig;
  const Stream stream(rig);
  const auto result = ctl(rig, {"watch", "--seconds", "1.5", "--json", "--summary"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out,
              AllOf(StartsWith("{\"summary\":false,"), HasSubstr("\n{\"summary\":true,")));
  EXPECT_EQ(result.out.find("\"depth\":{"), std::string::npos) << "no map was asked for";
  const auto whole = ctl(rig, {"watch", "--seconds", "1.5", "--json"});
  EXPECT_THAT(whole.out, HasSubstr("\"depth\":{"));
}

TEST(Watch, ReturnsFourWhenDepthIsTooSlow) {
  Rig rig;
  pipeline::Status status;
  status.state = pipeline::State::camera_lost;
  rig.port.set_status(status);
  const auto result = ctl(rig, {"watch", "--seconds", "1.2", "--min-fps", "57"});
  EXPECT_EQ(result.code, 4);
  EXPECT_THAT(result.out, HasSubstr("no frames: camera_lost"));
  EXPECT_THAT(result.error, HasSubstr("57 were asked for"));
}

TEST(Watch, ReturnsThreeWhenTheDaemonEnds) {
  Rig rig;
  std::thread end([&rig] {
    (void)rig.port.wait_wanted({.contact = true, .depth = true});
    rig.stop();
  });
  const auto result = ctl(rig, {"watch"});
  end.join();
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.error, HasSubstr("ended the connection"));
}

}  // namespace
}  // namespace dtact::ctl
