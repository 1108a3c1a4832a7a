// The daemon under systemd's watchdog: fed as long as its capture thread runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <string>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/e2e/daemon_process.hpp"

namespace dtact::e2e {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

/// A daemon of a service whose WatchdogSec= is 0.4 s, fed every 0.05 s.
class Watched {
 public:
  explicit Watched(const std::vector<std::string>& settings)
      : daemon_(arguments(settings), {{"WATCHDOG_USEC", "400000"}}) {}

  /// The longest time without a message to the watchdog within `span` from now.
  [[nodiscard]] std::chrono::milliseconds longest_silence(std::chrono::milliseconds span) const {
    const auto end = Clock::now() + span;
    auto last = Clock::now();
    std::chrono::milliseconds longest{0};
    for (auto now = last; now < end; now = Clock::now()) {
      const auto rest = std::chrono::ceil<std::chrono::milliseconds>(end - now);
      const auto message = daemon_.next_notification(rest);
      longest =
          std::max(longest, std::chrono::floor<std::chrono::milliseconds>(Clock::now() - last));
      if (message == "WATCHDOG=1") last = Clock::now();
    }
    return longest;
  }
  [[nodiscard]] int stop() { return daemon_.stop(SIGTERM); }

 private:
  [[nodiscard]] std::vector<std::string> arguments(const std::vector<std::string>& settings) const {
    std::vector<std::string> arguments;
    for (const std::string& setting : settings) {
      arguments.insert(arguments.end(), {"--set", setting});
    }
    arguments.insert(arguments.end(),
                     {"--set", "net.port=0", "--set", "state_dir=" + folder_.path().string()});
    return arguments;
  }

  TempFolder folder_;
  DaemonProcess daemon_;
};

// The null camera's frames have no reader, and the daemon is healthy all the same.
TEST(Watchdog, IsFedByADaemonWithTheNullCamera) {
  Watched daemon({"camera.backend=null", "ring.backend=null"});
  EXPECT_LT(daemon.longest_silence(3s), 1s);
  EXPECT_EQ(daemon.stop(), 0);
}

TEST(Watchdog, IsNotFedWhileTheCameraHangs) {
  const TempFolder folder;
  const auto scene = folder.path() / "hang.toml";
  // From 2 s after the start, for 3 s.
  base::write_file_atomically(scene, "[[fault]]\nkind = 'hang'\nframe = 120\nframes = 180\n");
  Watched daemon({"camera.backend=sim", "camera.sim.scene=" + scene.string()});
  EXPECT_GT(daemon.longest_silence(6s), 2s);
  EXPECT_LT(daemon.longest_silence(2s), 1s);
  EXPECT_EQ(daemon.stop(), 0);
}

}  // namespace
}  // namespace dtact::e2e
