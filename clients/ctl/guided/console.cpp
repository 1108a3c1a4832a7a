#include "clients/ctl/guided/console.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <ostream>
#include <utility>

namespace dtact::ctl::guided {
namespace {

bool ready(int descriptor) {
  pollfd waiting{descriptor, POLLIN, 0};
  return ::poll(&waiting, 1, 0) > 0;
}

std::string trimmed(const std::string& text) {
  constexpr const char* kBlanks = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

}  // namespace

StreamConsole::StreamConsole(int in, std::ostream& out, bool interactive,
                             std::function<bool()> interrupted)
    : in_(in), out_(out), interactive_(interactive), interrupted_(std::move(interrupted)) {}

StreamConsole::~StreamConsole() {
  clear_live();
  out_.flush();
}

bool StreamConsole::fetch() {
  if (!ready(in_)) return true;
  std::array<char, 4096> chunk{};
  const ssize_t count = ::read(in_, chunk.data(), chunk.size());
  if (count < 0) return errno == EINTR || errno == EAGAIN;
  buffer_.append(chunk.data(), static_cast<std::size_t>(count));
  return count > 0;
}

Typed StreamConsole::typed() {
  if (interrupted_()) return {Typed::Kind::interrupted, {}};
  std::size_t end = buffer_.find('\n');
  if (end == std::string::npos && !ended_) {
    ended_ = !fetch();
    end = buffer_.find('\n');
  }
  if (end != std::string::npos) {
    Typed line{Typed::Kind::line, trimmed(buffer_.substr(0, end))};
    buffer_.erase(0, end + 1);
    // The terminal has echoed the end of the line: the cursor stands below the live lines.
    if (live_lines_ > 0) ++live_lines_;
    return line;
  }
  if (!ended_) return {};
  // A last line need not end in a newline.
  if (!buffer_.empty()) return {Typed::Kind::line, trimmed(std::exchange(buffer_, {}))};
  return {Typed::Kind::end, {}};
}

void StreamConsole::say(const std::string& text) {
  clear_live();
  out_ << text;
  if (text.empty() || text.back() != '\n') out_ << '\n';
  out_.flush();
}

void StreamConsole::live(const std::vector<std::string>& lines) {
  // A line that waits to be read has moved the cursor already.
  if (!interactive_ || ready(in_)) return;
  clear_live();
  // A line that is too long for the terminal must not become two.
  out_ << "\x1b[?7l";
  for (std::size_t i = 0; i < lines.size(); ++i) out_ << (i > 0 ? "\n" : "") << lines[i];
  out_ << "\x1b[?7h" << std::flush;
  live_lines_ = lines.size();
}

void StreamConsole::clear_live() {
  if (live_lines_ == 0) return;
  out_ << '\r';
  if (live_lines_ > 1) out_ << "\x1b[" << live_lines_ - 1 << 'A';
  out_ << "\x1b[J";
  live_lines_ = 0;
}

}  // namespace dtact::ctl::guided
