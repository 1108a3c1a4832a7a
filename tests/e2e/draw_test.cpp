// dtactctl watch --draw in a pseudo-terminal.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

/// A program in a terminal of 80 × 24 characters.
class InTerminal {
 public:
  explicit InTerminal(std::vector<std::string> arguments) {
    const winsize size{24, 80, 0, 0};
    int master = -1;
    pid_ = ::forkpty(&master, nullptr, nullptr, &size);
    if (pid_ == 0) {
      ::setenv("TERM", "xterm-256color", 1);
      ::setenv("COLORTERM", "truecolor", 1);
      std::vector<char*> argv;
      for (std::string& argument : arguments) argv.push_back(argument.data());
      argv.push_back(nullptr);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    master_ = base::UniqueFd(master);
  }
  ~InTerminal() {
    if (pid_ > 0) ::kill(pid_, SIGKILL);
  }
  InTerminal(const InTerminal&) = delete;
  InTerminal& operator=(const InTerminal&) = delete;

  /// Reads until `text` was written, or all when it is empty.
  bool read_until(const std::string& text) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (text.empty() || written.find(text) == std::string::npos) {
      pollfd readable{master_.get(), POLLIN, 0};
      if (::poll(&readable, 1, 1000) < 0 || std::chrono::steady_clock::now() > end) return false;
      if (readable.revents == 0) continue;
      char buffer[4096];
      const ssize_t n = ::read(master_.get(), buffer, sizeof buffer);
      if (n <= 0) return text.empty();
      written.append(buffer, static_cast<std::size_t>(n));
    }
    return true;
  }
  void press_ctrl_c() const { (void)!::write(master_.get(), "\x03", 1); }
  int exit_status() {
    int status = 0;
    ::waitpid(std::exchange(pid_, -1), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }

  std::string written;

 private:
  base::UniqueFd master_;
  pid_t pid_ = -1;
};

TEST(Draw, ShowsDepthAndGivesTheTerminalBack) {
  const Sensor sensor(scene_file("calibrate_ball.toml"));
  InTerminal watch(
      {DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port()), "watch", "--draw"});
  ASSERT_TRUE(watch.read_until(" mm deep")) << watch.written;
  ASSERT_TRUE(watch.read_until(" fps  contact")) << watch.written;
  watch.press_ctrl_c();
  ASSERT_TRUE(watch.read_until("")) << watch.written;
  EXPECT_EQ(watch.exit_status(), 0);
  EXPECT_THAT(watch.written, AllOf(StartsWith("\x1b[?1049h\x1b[?25l"), HasSubstr("\x1b[38;2;"),
                                   HasSubstr("\u2580")));
  const auto back = watch.written.find("\x1b[0m\x1b[?25h\x1b[?1049l");
  ASSERT_NE(back, std::string::npos);
  EXPECT_THAT(watch.written.substr(back), AllOf(HasSubstr("watched "), EndsWith("\r\n")));
}

TEST(Draw, NeedsATerminal) {
  const Sensor sensor({}, false);
  std::string output;
  EXPECT_EQ(run_program({DTACTCTL_PROGRAM, "--port", std::to_string(sensor.daemon->port()), "watch",
                         "--draw"},
                        &output),
            2);
  EXPECT_THAT(output, HasSubstr("--draw needs a terminal, and the output is none"));
}

}  // namespace
}  // namespace dtact::e2e
