// dtactctl setup on the simulated sensor, with a systemctl of the test's own: from a configuration
// of another camera to a calibrated service.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <thread>

#include "hal/base/atomic_file.hpp"
#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr int kNotMet = 4;

/// A machine with a service: its configuration, the programs in one folder, and a systemctl that
/// starts the daemon anew.
class Setup : public testing::Test {
 public:
  ~Setup() override {
    if (!fs::exists(file("pid"))) return;
    const pid_t pid = std::stoi(base::read_file(file("pid")));
    ::kill(pid, SIGTERM);
    // It writes into the folder until it has ended.
    while (::kill(pid, 0) == 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }

 protected:
  Setup() {
    const fs::path bin = folder_.path() / "bin";
    fs::create_directories(bin);
    for (const char* program : {DTACTD_PROGRAM, DTACTCTL_PROGRAM, CALIBRATE_PROGRAM}) {
      fs::create_symlink(program, bin / fs::path(program).filename());
    }
    std::string text = base::read_file(DTACT_SOURCE_DIR "/config/dtactd.toml");
    replace(text, "backend = \"sim\"\nwidth", "backend = \"null\"\nwidth");
    replace(text, "scene = \"\"",
            "scene = \"" + scene_file("calibration_presses.toml").string() + "\"");
    replace(text, "calibration = \"/usr/share/dtactd/simulated\"", "calibration = \"\"");
    replace(text, "state_dir = \"\"", "state_dir = \"" + file("state").string() + "\"");
    replace(text, "port = 7377 ", fmt::format("port = {} ", port_));
    base::write_file_atomically(config(), text);
    std::ofstream(bin / "systemctl") << fmt::format(
        "#!/bin/sh\n[ \"$*\" = 'restart dtactd' ] || exit 1\ncd '{0}'\n"
        "[ ! -e pid ] || kill \"$(cat pid)\"\n"
        "while [ -e pid ] && kill -0 \"$(cat pid)\" 2>/dev/null; do sleep 0.1; done\n"
        "dtactd --config '{1}' </dev/null >log 2>&1 &\necho $! >pid\n",
        folder_.path().string(), config().string());
    fs::permissions(bin / "systemctl", fs::perms::owner_all);
  }

  static void replace(std::string& text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    if (at == std::string::npos) throw std::runtime_error("no " + from);
    text.replace(at, from.size(), to);
  }
  [[nodiscard]] fs::path file(const std::string& name) const { return folder_.path() / name; }
  [[nodiscard]] fs::path config() const { return file("dtactd.toml"); }

  /// Runs it in the folder, with these lines typed.
  int setup(const std::vector<std::string>& arguments, const std::string& typed = "") {
    std::vector<std::string> command = {"/usr/bin/env",
                                        "-C",
                                        folder_.path().string(),
                                        "PATH=" + file("bin").string() + ":/usr/bin:/bin",
                                        "dtactctl",
                                        "setup",
                                        "--config",
                                        config().string()};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return run_program(command, &output_, typed);
  }

  std::uint16_t port_ = free_port();
  std::string output_;

 private:
  TempFolder folder_;
};

TEST_F(Setup, FromAnotherCameraToDepth) {
  const std::string before = base::read_file(config());
  // The radius is asked; what is typed after it is the guided session's.
  ASSERT_EQ(setup({"--camera", "sim", "--mm-per-px", "0.0413793", "--crop", kCrop},
                  "4.0\n" + std::string(60, '\n')),
            0)
      << output_;
  EXPECT_THAT(output_,
              AllOf(HasSubstr("1 of 5: camera\n  camera.backend = \"sim\" (was \"null\")"),
                    HasSubstr("nothing is wrong"), HasSubstr("the service runs: camera sim:"),
                    HasSubstr("the daemon uses calibration dtact-calibration from now on"),
                    HasSubstr(" with depth, ")));
  std::string expected = before;
  replace(expected, "backend = \"null\"\nwidth", "backend = \"sim\"\nwidth");
  EXPECT_EQ(base::read_file(config()), expected);

  // Each step again, alone.
  EXPECT_EQ(setup({"camera", "--camera", "sim"}), 0) << output_;
  EXPECT_THAT(output_, AllOf(HasSubstr("has these settings already"), Not(HasSubstr("2 of 5"))));
  EXPECT_EQ(setup({"check"}), 0) << output_;
  EXPECT_EQ(setup({"restart", "watch"}), 0) << output_;
  EXPECT_THAT(output_, AllOf(HasSubstr("3 of 5"), HasSubstr("5 of 5"), Not(HasSubstr("4 of 5"))));
  // All of them: the calibration stays.
  EXPECT_EQ(setup({"--camera", "sim"}), 0) << output_;
  EXPECT_THAT(output_, HasSubstr("is calibrated, by dtact-calibration; dtactctl setup calibrate"));
  // A session that ends early: the folder's calibration is the earlier one.
  EXPECT_EQ(setup({"calibrate", "--radius-mm", "4.0", "--mm-per-px", "0.0413793"}), kNotMet);
  EXPECT_THAT(output_, HasSubstr("no calibration was made; what was taken is in "));
}

// Before: one made anew in the folder of an earlier session counted as none.
TEST_F(Setup, NamesACalibrationThatWasMadeAnewAndNotUploaded) {
  const fs::path bin = file("bin");
  fs::remove(bin / "dtactctl");
  fs::copy_file(DTACTCTL_PROGRAM, bin / "dtactctl");  // what lies beside it is what it runs
  fs::remove(bin / "dtact-calibrate");
  std::ofstream(bin / "dtact-calibrate") << "#!/bin/sh\n"
                                            "while [ \"$1\" != --folder ]; do shift; done\n"
                                            "mkdir \"$2/calibration/anew\"\n"
                                            "exit 4\n";
  fs::permissions(bin / "dtact-calibrate", fs::perms::owner_all);
  const fs::path made = file("again/calibration");
  fs::create_directories(made);
  fs::last_write_time(made, fs::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_EQ(
      setup({"calibrate", "--folder", "again", "--radius-mm", "4.0", "--mm-per-px", "0.0413793"}),
      kNotMet);
  EXPECT_THAT(output_, AllOf(HasSubstr("calibration is made but not in use"),
                             HasSubstr("calibration upload "), Not(HasSubstr("no calibration"))));
}

TEST_F(Setup, ReachesADaemonWithoutTcpByItsSocket) {
  std::string text = base::read_file(config());
  replace(text, "[net]", fmt::format("[net]\nunix_socket = \"{}\"", file("sock").string()));
  replace(text, "\nunix_socket = \"\"", "");
  replace(text, "address = \"127.0.0.1\"", "address = \"\"");
  base::write_file_atomically(config(), text);
  EXPECT_EQ(setup({"camera", "restart", "--camera", "sim"}), 0) << output_;
  EXPECT_THAT(output_, HasSubstr("the service runs: camera sim:"));
  // There is no depth yet, but watch gets as far as the daemon.
  (void)setup({"watch"});
  EXPECT_THAT(output_, HasSubstr(" --host unix:" + file("sock").string() + " watch"));
  EXPECT_THAT(output_, Not(HasSubstr("nothing listens")));
}

TEST_F(Setup, StopsWithWhatToDoAndHowToGoOn) {
  const std::string before = base::read_file(config());
  EXPECT_EQ(setup({"--camera", "serial:none"}), kNotMet);
  EXPECT_THAT(output_, AllOf(HasSubstr("no camera serial:none is attached"),
                             HasSubstr("then continue with: dtactctl setup --config "),
                             HasSubstr(" --camera serial:none"),
                             HasSubstr(" camera check restart calibrate watch")));
  // A file of the administrator's own.
  std::ofstream(file("dtactd.toml.new")) << "mine";
  std::ofstream(file("board.toml")) << "[camera]\nbackend = \"libcamera\"\nwidth = 1\n";
  EXPECT_EQ(setup({"camera", "--board", file("board.toml").string()}), kNotMet);
  EXPECT_THAT(output_, AllOf(HasSubstr("camera.width"), HasSubstr("nothing is written")));
  EXPECT_EQ(base::read_file(config()), before);
  EXPECT_EQ(base::read_file(file("dtactd.toml.new")), "mine");
  EXPECT_EQ(
      std::ranges::count_if(fs::directory_iterator(config().parent_path()),
                            [](const fs::directory_entry& entry) {
                              return entry.path().filename().string().starts_with("dtactd.toml.");
                            }),
      1);
  EXPECT_EQ(setup({"restart", "--unit", "dtactd@none"}), kNotMet);
  EXPECT_THAT(output_, HasSubstr("the service does not start: systemctl status dtactd@none"));
  EXPECT_EQ(setup({"calibrate"}), kNotMet);
  EXPECT_THAT(output_, HasSubstr("give --radius-mm, and --mm-per-px, --ruler or --lens"));
  EXPECT_EQ(setup({"guess"}), 2);
}

}  // namespace
}  // namespace dtact::e2e
