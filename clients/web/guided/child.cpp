#include "clients/web/guided/child.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/buffer.hpp>
#include <boost/asio/error.hpp>
#include <boost/asio/read_until.hpp>
#include <boost/asio/write.hpp>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <system_error>
#include <utility>

#include "hal/base/unique_fd.hpp"

namespace dtact::web {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

constexpr std::chrono::seconds kTimeout{5};
/// As Child::kSecretFile names it.
constexpr int kSecret = 3;
/// Bytes kept of the error output: its end, which has the reason.
constexpr std::size_t kMaxErrors = 2000;

[[noreturn]] void fail(int error, const std::string& what) {
  throw std::system_error(error, std::generic_category(), what);
}

struct Pipe {
  Pipe() {
    std::array<int, 2> ends{};
    if (::pipe2(ends.data(), O_CLOEXEC) != 0) fail(errno, "pipe");
    read.reset(ends[0]);
    write.reset(ends[1]);
  }
  base::UniqueFd read;
  base::UniqueFd write;
};

/// Both ends write and read.
struct Pair {
  Pair() {
    std::array<int, 2> ends{};
    if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
      fail(errno, "socketpair");
    }
    here.reset(ends[0]);
    there.reset(ends[1]);
  }
  base::UniqueFd here;
  base::UniqueFd there;
};

/// A file without a name that no other process can read.
base::UniqueFd secret_file(const std::string& secret) {
  base::UniqueFd file(::memfd_create("secret", MFD_CLOEXEC));
  if (!file || ::fchmod(file.get(), S_IRUSR | S_IWUSR) != 0 ||
      ::write(file.get(), secret.data(), secret.size()) != static_cast<ssize_t>(secret.size())) {
    fail(errno, "memfd");
  }
  return file;
}

/// Arguments of posix_spawn.
class Spawning {
 public:
  Spawning() {
    ::posix_spawn_file_actions_init(&actions_);
    ::posix_spawnattr_init(&attributes_);
    sigset_t none;
    sigset_t all;
    ::sigemptyset(&none);
    ::sigfillset(&all);
    // Which signals this program ignores or blocks is no business of the other.
    ::posix_spawnattr_setsigmask(&attributes_, &none);
    ::posix_spawnattr_setsigdefault(&attributes_, &all);
    ::posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
  }
  ~Spawning() {
    ::posix_spawn_file_actions_destroy(&actions_);
    ::posix_spawnattr_destroy(&attributes_);
  }
  Spawning(const Spawning&) = delete;
  Spawning& operator=(const Spawning&) = delete;

  void give(const base::UniqueFd& file, int as) {
    ::posix_spawn_file_actions_adddup2(&actions_, file.get(), as);
  }
  /// Asio's sockets would live on in the other program after they were closed here.
  void keep_all_from(int first) { ::posix_spawn_file_actions_addclosefrom_np(&actions_, first); }
  [[nodiscard]] pid_t start(std::vector<std::string>& words) const {
    std::vector<char*> argv;
    argv.reserve(words.size() + 1);
    for (std::string& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    pid_t pid = -1;
    const int error = ::posix_spawnp(&pid, argv[0], &actions_, &attributes_, argv.data(), environ);
    if (error != 0) fail(error, words.front());
    return pid;
  }

 private:
  posix_spawn_file_actions_t actions_{};
  posix_spawnattr_t attributes_{};
};

}  // namespace

Child::Child(const asio::any_io_executor& executor)
    : in_(executor), out_(executor), errors_(executor), process_(executor), timeout_(executor) {}

Child::~Child() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  ::waitpid(pid_, nullptr, 0);
}

void Child::start(std::vector<std::string> words, const std::string& secret, Handlers handlers) {
  Pair in;
  Pipe out;
  Pipe errors;
  const base::UniqueFd file = secret.empty() ? base::UniqueFd() : secret_file(secret);
  Spawning spawning;
  spawning.give(in.there, STDIN_FILENO);
  spawning.give(out.write, STDOUT_FILENO);
  spawning.give(errors.write, STDERR_FILENO);
  if (file) spawning.give(file, kSecret);
  spawning.keep_all_from(file ? kSecret + 1 : kSecret);
  pid_ = spawning.start(words);
  const auto process = static_cast<int>(::syscall(SYS_pidfd_open, pid_, 0));
  if (process < 0) fail(errno, "pidfd_open");
  handlers_ = std::move(handlers);
  in_.assign(asio::local::stream_protocol(), in.here.release());
  out_.assign(out.read.release());
  errors_.assign(errors.read.release());
  process_.assign(process);
  open_ = 3;
  read_line();
  read_errors();
  await_exit();
}

bool Child::type(const std::string& line) {
  if (typed_.size() + line.size() > kMaxTyped) return false;
  typed_ += line + '\n';
  if (writing_.empty()) write_next();
  return true;
}

void Child::write_next() {
  if (typed_.empty() || !in_.is_open()) return;
  writing_ = std::exchange(typed_, {});
  asio::async_write(in_, asio::buffer(writing_),
                    [self = shared_from_this()](const error_code& error, std::size_t) {
                      self->writing_.clear();
                      // One that reads no more is about to end.
                      if (!error) self->write_next();
                    });
}

void Child::end() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGTERM);
  timeout_.expires_after(kTimeout);
  timeout_.async_wait([weak = weak_from_this()](const error_code& error) {
    const auto self = weak.lock();
    if (!error && self != nullptr && self->pid_ >= 0) ::kill(self->pid_, SIGKILL);
  });
}

void Child::read_line() {
  asio::async_read_until(out_, asio::dynamic_buffer(output_, kMaxLine), '\n',
                         [self = shared_from_this()](const error_code& error, std::size_t size) {
                           if (error) {
                             // The line is too long; else it is the end.
                             if (error == asio::error::not_found && self->pid_ >= 0)
                               ::kill(self->pid_, SIGKILL);
                             return self->one_over();
                           }
                           std::string line = self->output_.substr(0, size - 1);
                           self->output_.erase(0, size);
                           self->handlers_.line(std::move(line));
                           self->read_line();
                         });
}

void Child::read_errors() {
  errors_.async_read_some(asio::buffer(piece_),
                          [self = shared_from_this()](const error_code& error, std::size_t size) {
                            if (error) return self->one_over();
                            self->said_.append(self->piece_.data(), size);
                            if (self->said_.size() > kMaxErrors) {
                              self->said_.erase(0, self->said_.size() - kMaxErrors);
                            }
                            self->read_errors();
                          });
}

void Child::await_exit() {
  process_.async_wait(Stream::wait_read, [self = shared_from_this()](const error_code& error) {
    if (error) return self->one_over();
    ::waitpid(self->pid_, &self->status_, 0);
    self->pid_ = -1;
    self->timeout_.cancel();
    self->one_over();
  });
}

void Child::one_over() {
  if (--open_ > 0) return;
  // The handlers may hold who holds this.
  const Handlers handlers = std::exchange(handlers_, {});
  handlers.ended(status_, said_);
}

}  // namespace dtact::web
