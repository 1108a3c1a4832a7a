#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace dtact::e2e {

/// A temporary folder, removed at the end.
class TempFolder {
 public:
  TempFolder();
  TempFolder(const TempFolder&) = delete;
  TempFolder& operator=(const TempFolder&) = delete;
  ~TempFolder();
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// A TCP port of loopback that nobody listens on at this moment.
[[nodiscard]] std::uint16_t free_port();

/// Runs a program to its end. Returns its exit status (128 + signal when it was killed); `output`
/// receives what it printed on both streams; `input` is what it reads.
int run_program(const std::vector<std::string>& arguments, std::string* output = nullptr,
                const std::string& input = "");

/// Variables beside those of this program.
using Environment = std::vector<std::pair<std::string, std::string>>;

/// A program that runs until it is stopped, without input.
class Program {
 public:
  /// `arguments`: its file first. `environment` adds to this program's.
  explicit Program(const std::vector<std::string>& arguments, const Environment& environment = {});
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;
  ~Program();

  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Whether it has ended without stop().
  [[nodiscard]] bool ended();
  /// Its output on both streams so far.
  [[nodiscard]] std::string log() const;
  /// Sends `signal` and waits. Returns the exit status, 128 + signal when it was killed, or −1 when
  /// it did not end within 20 s (it is killed then).
  int stop(int signal);

 private:
  TempFolder folder_;
  pid_t pid_ = -1;
};

}  // namespace dtact::e2e
