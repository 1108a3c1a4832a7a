#pragma once

#include <sys/types.h>

#include <array>
#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/local/stream_protocol.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace dtact::web {

/// Another program that is spoken with in lines. On one thread, that of its executor.
class Child : public std::enable_shared_from_this<Child> {
 public:
  /// The longest line that is taken; one that is longer ends the program.
  static constexpr std::size_t kMaxLine = std::size_t{8} << 20U;
  static constexpr std::size_t kMaxTyped = std::size_t{64} << 10U;
  /// The path of the secret's file, as the program sees it.
  static constexpr const char* kSecretFile = "/proc/self/fd/3";

  struct Handlers {
    std::function<void(std::string)> line;  ///< Without its newline.
    /// Once, as the last: the status as of waitpid(), and the end of what it wrote as errors.
    std::function<void(int, std::string)> ended;
  };

  explicit Child(const boost::asio::any_io_executor& executor);
  /// Kills it where it still runs.
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  /// Starts `words`, the first of which is looked up in PATH unless it has a '/'. `secret`: what
  /// kSecretFile holds; empty: there is none. Throws std::system_error.
  void start(std::vector<std::string> words, const std::string& secret, Handlers handlers);
  [[nodiscard]] bool runs() const noexcept { return pid_ >= 0; }
  /// Sends a line. False, and it is not sent, where more than kMaxTyped bytes would wait.
  [[nodiscard]] bool type(const std::string& line);
  /// Asks it to end (SIGTERM), and ends it a few seconds later. Handlers are called all the same.
  void end();

 private:
  using Stream = boost::asio::posix::stream_descriptor;

  void read_line();
  void read_errors();
  void write_next();
  void await_exit();
  /// One of the three that have to be over is.
  void one_over();

  /// Not a pipe: to write into one whose reader is gone would end this program.
  boost::asio::local::stream_protocol::socket in_;
  Stream out_;
  Stream errors_;
  Stream process_;  ///< A pidfd.
  boost::asio::steady_timer timeout_;
  Handlers handlers_;
  pid_t pid_ = -1;  ///< −1: not there, or waited for.
  int status_ = 0;
  int open_ = 0;  ///< Open ones of exit, output and errors.
  std::string output_;
  std::array<char, 1024> piece_{};
  std::string said_;  ///< End of the error output.
  std::string typed_;
  std::string writing_;
};

}  // namespace dtact::web
