#include "clients/calibrate/guided/console.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <ostream>
#include <string_view>
#include <utility>

namespace dtact::ctl::guided {
namespace {

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

void StreamConsole::fetch() {
  pollfd waiting{in_, POLLIN, 0};
  if (ended_ || ::poll(&waiting, 1, 0) <= 0) return;
  std::array<char, 4096> chunk{};
  const ssize_t count = ::read(in_, chunk.data(), chunk.size());
  if (count < 0) {
    ended_ = errno != EINTR && errno != EAGAIN;
    return;
  }
  ended_ = count == 0;
  const std::string_view text(chunk.data(), static_cast<std::size_t>(count));
  buffer_ += text;
  // The terminal has echoed them: the cursor stands so much below the live lines.
  if (live_lines_ > 0) {
    live_lines_ += static_cast<std::size_t>(std::ranges::count(text, '\n'));
  }
}

Typed StreamConsole::typed() {
  if (interrupted_()) return {Typed::Kind::interrupted, {}};
  fetch();
  if (const std::size_t end = buffer_.find('\n'); end != std::string::npos) {
    Typed line{Typed::Kind::line, trimmed(buffer_.substr(0, end))};
    buffer_.erase(0, end + 1);
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
  if (!interactive_) return;
  clear_live();
  // A line that is too long for the terminal must not become two.
  out_ << "\x1b[?7l";
  for (std::size_t i = 0; i < lines.size(); ++i) out_ << (i > 0 ? "\n" : "") << lines[i];
  out_ << "\x1b[?7h" << std::flush;
  live_lines_ = lines.size();
}

void StreamConsole::clear_live() {
  if (live_lines_ == 0) return;
  fetch();  // what was typed meanwhile has moved the cursor
  out_ << '\r';
  if (live_lines_ > 1) out_ << "\x1b[" << live_lines_ - 1 << 'A';
  out_ << "\x1b[J";
  live_lines_ = 0;
}

}  // namespace dtact::ctl::guided
