#include "tests/kernel/camera/usb_camera.hpp"

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <thread>

extern char** environ;

namespace dtact::kernel_test {

UsbCamera::UsbCamera(const std::vector<std::string>& arguments) {
  std::vector<std::string> owned = {DTACT_UVCFAKE};
  owned.insert(owned.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  argv.reserve(owned.size() + 1);
  for (std::string& a : owned) argv.push_back(a.data());
  argv.push_back(nullptr);
  if (::posix_spawn(&pid_, DTACT_UVCFAKE, nullptr, nullptr, argv.data(), environ) != 0) {
    throw std::runtime_error("cannot start " DTACT_UVCFAKE);
  }
}

void UsbCamera::unplug() {
  if (pid_ <= 0) return;
  ::kill(pid_, SIGTERM);
  ::waitpid(pid_, nullptr, 0);
  pid_ = -1;
}

void UsbCamera::toggle_freeze() const { ::kill(pid_, SIGUSR1); }
void UsbCamera::drift() const { ::kill(pid_, SIGUSR2); }

bool eventually(double seconds, const std::function<bool()>& condition) {
  for (const double deadline = now_s() + seconds; now_s() < deadline;) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return condition();
}

double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace dtact::kernel_test
