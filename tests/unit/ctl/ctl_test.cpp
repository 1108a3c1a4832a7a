// The program against the server with a pipeline that the tests play.
#include "clients/ctl/ctl.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <thread>

#include "clients/cpp/client.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/image/png.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;
using net::test::answer_done;
using net::test::FakePort;
using net::test::make_frame;
using net::test::Rig;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

struct Result {
  int code = 0;
  std::string out;
  std::string error;
};

Result ctl(std::vector<std::string> arguments) {
  std::ostringstream out;
  std::ostringstream error;
  const int code = run(arguments, out, error);
  return {code, out.str(), error.str()};
}

/// With the rig's port.
Result ctl(const Rig& rig, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {"--port", std::to_string(rig.tcp_port())});
  return ctl(std::move(arguments));
}

TEST(Ctl, ExplainsItself) {
  const auto help = ctl({"--help"});
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out,
              AllOf(HasSubstr("status"), HasSubstr("watch"), HasSubstr("led"), HasSubstr("rezero"),
                    HasSubstr("calibration"), HasSubstr("3 no connection")));
  const auto version = ctl({"--version"});
  EXPECT_EQ(version.code, 0);
  EXPECT_THAT(version.out, StartsWith("dtactctl "));
}

TEST(Ctl, ReturnsTwoForWrongUsage) {
  EXPECT_EQ(ctl({}).code, 2);
  EXPECT_EQ(ctl({"dance"}).code, 2);
  EXPECT_EQ(ctl({"status", "--frobnicate"}).code, 2);
  EXPECT_EQ(ctl({"--port", "0", "status"}).code, 2);
  EXPECT_EQ(ctl({"led", "--brightness", "256"}).code, 2);
  EXPECT_EQ(ctl({"led", "--led", "9:ffffff"}).code, 2);
  EXPECT_EQ(ctl({"watch", "--seconds", "-1"}).code, 2);
  EXPECT_EQ(ctl({"calibration"}).code, 2);
  EXPECT_EQ(ctl({"calibration", "upload", "/no/such/folder"}).code, 2);
}

TEST(Ctl, ReturnsThreeWithoutADaemon) {
  std::uint16_t port = 0;
  {
    const Rig rig;
    port = rig.tcp_port();
  }
  const auto result = ctl({"--port", std::to_string(port), "status"});
  EXPECT_EQ(result.code, 3);
  EXPECT_THAT(result.error, AllOf(StartsWith("dtactctl: nothing listens on 127.0.0.1"),
                                  HasSubstr("systemctl status dtactd")));
}

TEST(Status, TellsWhereTheDaemonListens) {
  net::NetConfig config;
  config.address = "0.0.0.0";
  config.insecure = true;
  const Rig rig(config);
  const auto result = ctl(rig, {"status"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out, HasSubstr("listens      0.0.0.0:" + std::to_string(rig.tcp_port()) +
                                    ", INSECURE: whoever can reach it"));
}

TEST(Status, IsPrinted) {
  Rig rig;
  pipeline::Status status;
  status.state = pipeline::State::serving;
  status.health.set(pipeline::Health::not_realtime);
  status.camera.backend = "sim";
  status.stages = {{"activity", 3, 9, 20}};
  status.light_followed = -0.0042;
  status.capture_thread = {5, 6, 7, 8};
  rig.port.set_status(status);
  const auto result = ctl(rig, {"status"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out,
              AllOf(HasSubstr("activity   p50 3 us, p99 9 us, max 20 us"), HasSubstr("0 encoded"),
                    HasSubstr("page faults 5 minor, 6 major; context switches 7 waiting, 8 pre")));
  EXPECT_THAT(result.out, AllOf(StartsWith("state        serving\nhealth       not_realtime\n"),
                                HasSubstr("LimitRTPRIO"), HasSubstr("camera       sim"),
                                HasSubstr("calibration  none"), HasSubstr("brightness 255"),
                                HasSubstr("reference    follows the light by -0.42 %")));
}

TEST(Status, SaysOfEachControlWhatIsKnown) {
  Rig rig;
  pipeline::Status status;
  status.camera.backend = "v4l2";
  status.camera.controls = {
      {"gain", 5, hal::ControlVerdict::confirmed},
      {"gamma", 120, hal::ControlVerdict::accepted},
      {"sharpness", 3, hal::ControlVerdict::refused, "the camera refuses sharpness = 2"}};
  rig.port.set_status(status);
  EXPECT_THAT(ctl(rig, {"status"}).out,
              HasSubstr("             gain 5, confirmed by the camera\n"
                        "             gamma 120, accepted, cannot be confirmed\n"
                        "             sharpness 3, refused: the camera refuses sharpness = 2\n"));
}

TEST(Status, IsOneLineOfJson) {
  Rig rig;
  const auto result = ctl(rig, {"status", "--json"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out,
              StartsWith(R"({"state":"STATE_SETTLING","health":[],"advice":"","camera":{)"));
  EXPECT_EQ(std::count(result.out.begin(), result.out.end(), '\n'), 1);
  EXPECT_THAT(result.out, Not(HasSubstr("\"calibration\":")));
  EXPECT_THAT(result.out, HasSubstr(R"("encoded":"0","capture_thread":{"minor_faults":"0",)"));
}

TEST(Led, ShowsAndChanges) {
  Rig rig({}, answer_done);
  EXPECT_EQ(ctl(rig, {"led"}).out,
            "brightness 255, LEDs ffffff ffffff ffffff ffffff ffffff ffffff ffffff ffffff\n");
  EXPECT_THAT(ctl(rig, {"led", "--brightness", "128", "--json"}).out,
              AllOf(StartsWith(R"({"brightness":128,"leds":[{"r":255,"g":255,"b":255},)"),
                    EndsWith("]}\n")));
  EXPECT_EQ(ctl(rig, {"led", "--scheme", "scheme1"}).out,
            "brightness 128, LEDs ffffff ffffff 000000 000000 ffffff ffffff 000000 000000\n");
}

TEST(Led, SaysWhatTheRingDoesNotShow) {
  Rig rig;
  pipeline::Status status;
  status.ring_message = "/dev/spidev0.0: cannot be opened: turn it on";
  rig.port.set_status(status);
  const auto result = ctl(rig, {"led"});
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.out, AllOf(StartsWith("brightness 255, LEDs"),
                                EndsWith("\n/dev/spidev0.0: cannot be opened: turn it on\n")));
  EXPECT_THAT(ctl(rig, {"led", "--json"}).out, Not(HasSubstr("spidev")));
}

TEST(Led, ChangesSingleOnes) {
  Rig rig({}, answer_done);
  const auto result = ctl(rig, {"led", "--led", "0:ff0000", "--led", "7:0000ff"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out,
            "brightness 255, LEDs ff0000 ffffff ffffff ffffff ffffff ffffff ffffff 0000ff\n");
}

TEST(Led, PassesRefusalsOn) {
  Rig rig({}, answer_done);
  const auto result = ctl(rig, {"led", "--scheme", "disco"});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error, HasSubstr("known are all, scheme1"));
}

TEST(Rezero, IsRefusedUnlessForced) {
  Rig rig({}, [](FakePort& port) {
    port.answer([](const pipeline::Command& command) {
      const bool force = std::get<pipeline::Rezero>(command.what).force;
      return pipeline::CommandDone{
          command.ticket, force ? pipeline::Outcome::done : pipeline::Outcome::refused_contact,
          force ? "" : "something touches"};
    });
  });
  const auto refused = ctl(rig, {"rezero"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_EQ(refused.error, "dtactctl: something touches\n");
  EXPECT_EQ(ctl(rig, {"rezero", "--force"}).code, 0);
}

/// The pipeline says that it uses a calibration.
void be_calibrated(Rig& rig, const std::string& name) {
  auto calibration = std::make_shared<calibration::Calibration>();
  calibration->name = name;
  pipeline::Status status;
  status.calibration = std::move(calibration);
  rig.port.set_status(status);
}

TEST(Calibration, GoesUpAndComesBack) {
  Rig rig({}, answer_done);
  be_calibrated(rig, "first");
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path temporary = ::mkdtemp(name.data());
  const fs::path folder = temporary / "ball";
  fs::create_directory(folder);
  base::write_file_atomically(folder / "calibration.toml", "version = 1\n");
  base::write_file_atomically(folder / "reference.png", "png");

  auto result = ctl(rig, {"calibration", "upload", folder.string() + "/"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out, "the daemon uses calibration ball (4) from now on\n");
  EXPECT_EQ(ctl(rig, {"calibration", "show"}).out, "# calibration ball (4)\nversion = 1\n");
  const std::string copy = (temporary / "copy").string();
  result = ctl(rig, {"calibration", "export", "-o", copy});
  EXPECT_EQ(result.out, copy + ": calibration ball (4)\n");
  EXPECT_EQ(base::read_file(copy + "/reference.png"), "png");
  EXPECT_EQ(base::read_file(copy + "/calibration.toml"), "version = 1\n");
  result = ctl(rig, {"calibration", "upload", folder.string(), "--name", "other", "--json"});
  EXPECT_EQ(result.out, R"({"name":"other","folder":"","number":"5"})"
                        "\n");
  result = ctl(rig, {"calibration", "upload", folder.string(), "--name", "no good"});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(ctl(rig, {"calibration", "upload", temporary.string()}).code, 1);
  fs::remove_all(temporary);
}

TEST(Calibration, IsExportedOnceUnlessForced) {
  const Rig rig({}, answer_done);
  std::string name = (fs::temp_directory_path() / "dtact-ctl-XXXXXX").string();
  const fs::path temporary = ::mkdtemp(name.data());
  const std::string folder = (temporary / "factory").string();
  auto result = ctl(rig, {"calibration", "export", "configured", "-o", folder, "--json"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_EQ(result.out, R"({"name":"factory","folder":")" + folder + "\",\"number\":\"0\"}\n");
  result = ctl(rig, {"calibration", "export", "2", "-o", folder});
  EXPECT_EQ(result.code, 1);
  EXPECT_THAT(result.error, AllOf(HasSubstr(folder + " exists"), HasSubstr("--force")));
  EXPECT_EQ(base::read_file(folder + "/calibration.toml"), "toml of factory");
  EXPECT_EQ(ctl(rig, {"calibration", "export", "2", "-o", folder, "--force"}).code, 0);
  EXPECT_EQ(base::read_file(folder + "/calibration.toml"), "bad");
  // What is no part of a calibration is not lost, forced or not.
  base::write_file_atomically(folder + "/notes.txt", "mine");
  EXPECT_EQ(ctl(rig, {"calibration", "export", "1", "-o", folder, "--force"}).code, 1);
  EXPECT_EQ(base::read_file(folder + "/calibration.toml"), "bad");
  EXPECT_EQ(ctl(rig, {"calibration", "export", "9", "-o", (temporary / "x").string()}).code, 1);
  EXPECT_FALSE(fs::exists(temporary / "x"));
  fs::remove_all(temporary);
}

TEST(Calibration, IsListed) {
  Rig rig;
  be_calibrated(rig, "first");
  EXPECT_EQ(
      ctl(rig, {"calibration", "list"}).out,
      "          id  uploaded              name         image        map    mm/px  method     "
      "range\n"
      "  configured  -                     factory    800x600    580x580   0.0414  list       "
      "-0.02 "
      "to 1.40 mm\n"
      "*          1  2026-01-31T12:00:00Z  first      800x600    580x580   0.0414  list       "
      "-0.02 "
      "to 1.40 mm\n"
      "           2  2026-01-31T12:00:00Z  broken   cannot be read: calibration.toml:3: scale "
      "missing\n"
      "           3  2026-01-31T12:00:00Z  stuck      800x600    580x580   0.0414  list       "
      "-0.02 "
      "to 1.40 mm\n");
  const std::string json = ctl(rig, {"calibration", "list", "--json"}).out;
  EXPECT_THAT(
      json,
      StartsWith(R"({"number":"0","name":"factory","uploaded":"","current":false,"summary":{)"
                 R"("name":"factory","method":"list","mm_per_px":0.0414,"width":580,"height":580,)"
                 R"("covered_from_mm":-0.02,"covered_to_mm":1.4,"created":"","frame_width":800,)"
                 R"("frame_height":600},"in_use":false})"
                 "\n"));
  EXPECT_THAT(json, HasSubstr(R"("name":"broken","uploaded":"2026-01-31T12:00:00Z",)"
                              R"("current":false,"damage":"calibration.toml:3: scale missing",)"));
  EXPECT_EQ(std::count(json.begin(), json.end(), '\n'), 4);
}

TEST(Calibration, InUseAndToStartWithAreToldApart) {
  Rig rig({}, answer_done);
  EXPECT_THAT(ctl(rig, {"calibration", "list"}).out,
              AllOf(HasSubstr("\n>          1"), EndsWith("none is in use\n"
                                                          "the daemon starts with 1 (>)\n")));
  be_calibrated(rig, "stuck");
  EXPECT_EQ(ctl(rig, {"calibration", "activate", "3"}).code, 1);  // disk full
  EXPECT_THAT(ctl(rig, {"calibration", "list"}).out,
              AllOf(HasSubstr("\n>          1"), HasSubstr("\n*          3"),
                    EndsWith("mm\nthe daemon starts with 1 (>)\n")));
  be_calibrated(rig, "ball");
  client::Options target;
  target.port = rig.tcp_port();
  v1::UploadCalibration files;
  files.set_name("ball");
  files.set_calibration_toml("unwritable");
  files.set_reference_png("png");
  EXPECT_THROW(client::Client(target).upload_calibration(files), client::Refused);
  EXPECT_THAT(ctl(rig, {"calibration", "list"}).out,
              AllOf(HasSubstr("\n>          1"), Not(HasSubstr("\n*")),
                    EndsWith("in use is ball, under no number that the daemon knows\n"
                             "the daemon starts with 1 (>)\n")));
}

TEST(Calibration, IsShownAndActivatedByItsId) {
  const Rig rig({}, answer_done);
  EXPECT_EQ(ctl(rig, {"calibration", "show", "configured"}).out,
            "# calibration factory (configured)\ntoml of factory");
  EXPECT_EQ(ctl(rig, {"calibration", "show", "1", "--json"}).out,
            // The files in base64.
            R"({"name":"first","calibration_toml":"dG9tbCBvZiBmaXJzdA==",)"
            R"("reference_png":"cG5nIG9mIGZpcnN0","number":"1"})"
            "\n");
  EXPECT_EQ(ctl(rig, {"calibration", "activate", "configured"}).out,
            "the daemon uses calibration configured from now on\n");
  EXPECT_EQ(ctl(rig, {"calibration", "activate", "1", "--json"}).out,
            R"({"name":"","folder":"","number":"1"})"
            "\n");
  const auto refused = ctl(rig, {"calibration", "activate", "2"});
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.error, HasSubstr("scale missing"));
  const auto wrong = ctl(rig, {"calibration", "show", "newest"});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.error, HasSubstr("a number that dtactctl calibration list shows"));
  EXPECT_EQ(ctl(rig, {"calibration", "show", "0"}).code, 2);
  EXPECT_EQ(ctl(rig, {"calibration", "activate"}).code, 2);
  EXPECT_EQ(ctl(rig, {"calibration", "export"}).code, 2);
}

/// Publishes frames until it is told to end.
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
                                HasSubstr("conditions: none\n")));
}

TEST(Watch, PrintsJson) {
  Rig rig;
  const Stream stream(rig);
  const auto result = ctl(rig, {"watch", "--seconds", "1.5", "--json", "--summary"});
  EXPECT_EQ(result.code, 0) << result.error;
  EXPECT_THAT(result.out,
              AllOf(StartsWith("{\"summary\":false,"), HasSubstr("\n{\"summary\":true,")));
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
