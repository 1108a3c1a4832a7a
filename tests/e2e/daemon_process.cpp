#include "tests/e2e/daemon_process.hpp"

#include <stdexcept>
#include <utility>

#include "tests/e2e/patience.hpp"

namespace dtact::e2e {
namespace {

using Clock = std::chrono::steady_clock;

std::vector<std::string> command(const std::vector<std::string>& arguments) {
  std::vector<std::string> all{DTACTD_PROGRAM};
  all.insert(all.end(), arguments.begin(), arguments.end());
  return all;
}

Environment with(Environment environment, const std::string& notify_socket) {
  environment.emplace_back("NOTIFY_SOCKET", notify_socket);
  return environment;
}

}  // namespace

DaemonProcess::DaemonProcess(const std::vector<std::string>& arguments, Environment environment)
    : notify_(folder_.path() / "notify"),
      program_(command(arguments), with(std::move(environment), notify_.path().string())) {
  wait_until_ready();
}

void DaemonProcess::wait_until_ready() {
  const auto deadline = Clock::now() + kSlower * std::chrono::seconds(60);
  while (Clock::now() < deadline) {
    if (const auto message = notify_.next(std::chrono::milliseconds(100))) {
      if (message->find("READY=1") != std::string::npos &&
          message->find("listening on ") != std::string::npos) {
        port_ = static_cast<std::uint16_t>(std::stoi(message->substr(message->rfind(':') + 1)));
        return;
      }
    }
    if (program_.ended()) {
      throw std::runtime_error("dtactd ended before it was ready:\n" + log());
    }
  }
  throw std::runtime_error("dtactd was not ready in time:\n" + log());
}

}  // namespace dtact::e2e
