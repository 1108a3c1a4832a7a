#include "tests/e2e/program.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "hal/base/atomic_file.hpp"
#include "hal/base/unique_fd.hpp"
#include "tests/e2e/patience.hpp"

namespace dtact::e2e {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

/// Starts a program with both output streams in `output`. It reads `input`.
pid_t spawn(const std::vector<std::string>& arguments, const fs::path& output,
            const fs::path& input, const Environment& environment) {
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  const base::UniqueFd log(::open(output.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  const base::UniqueFd in(::open(input.c_str(), O_RDONLY | O_CLOEXEC));
  if (log.get() < 0 || in.get() < 0) throw std::runtime_error("cannot open " + output.string());
  const pid_t pid = ::fork();
  if (pid < 0) throw std::runtime_error("cannot fork");
  if (pid == 0) {
    ::dup2(in.get(), STDIN_FILENO);
    ::dup2(log.get(), STDOUT_FILENO);
    ::dup2(log.get(), STDERR_FILENO);
    for (const auto& [name, value] : environment) ::setenv(name.c_str(), value.c_str(), 1);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  return pid;
}

int exit_status(int status) {
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace

TempFolder::TempFolder() {
  std::string name = (fs::temp_directory_path() / "dtact_e2e_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a temp folder");
  path_ = name;
}

TempFolder::~TempFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::uint16_t free_port() {
  const base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (::bind(fd.get(), reinterpret_cast<sockaddr*>(&address), size) != 0 ||
      ::getsockname(fd.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) {
    throw std::runtime_error("no free port");
  }
  return ntohs(address.sin_port);
}

int run_program(const std::vector<std::string>& arguments, std::string* output,
                const std::string& input) {
  const TempFolder folder;
  base::write_file_atomically(folder.path() / "input", input);
  const pid_t pid = spawn(arguments, folder.path() / "log", folder.path() / "input", {});
  int status = 0;
  ::waitpid(pid, &status, 0);
  if (output != nullptr) *output = base::read_file(folder.path() / "log");
  return exit_status(status);
}

Program::Program(const std::vector<std::string>& arguments, const Environment& environment)
    : pid_(spawn(arguments, folder_.path() / "log", "/dev/null", environment)) {}

bool Program::ended() {
  if (pid_ >= 0 && ::waitpid(pid_, nullptr, WNOHANG) == pid_) pid_ = -1;
  return pid_ < 0;
}

std::string Program::log() const { return base::read_file(folder_.path() / "log"); }

int Program::stop(int signal) {
  if (pid_ < 0) return -1;
  ::kill(pid_, signal);
  const auto deadline = Clock::now() + kSlower * std::chrono::seconds(20);
  int status = 0;
  while (::waitpid(pid_, &status, WNOHANG) != pid_) {
    if (Clock::now() > deadline) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, &status, 0);
      pid_ = -1;
      return -1;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  pid_ = -1;
  return exit_status(status);
}

Program::~Program() {
  if (pid_ >= 0) stop(SIGKILL);
}

}  // namespace dtact::e2e
