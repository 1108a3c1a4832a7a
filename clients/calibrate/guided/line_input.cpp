#include "clients/calibrate/guided/line_input.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
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

std::size_t LineInput::fetch() {
  pollfd waiting{descriptor_, POLLIN, 0};
  if (ended_ || ::poll(&waiting, 1, 0) <= 0) return 0;
  std::array<char, 4096> chunk{};
  const ssize_t count = ::read(descriptor_, chunk.data(), chunk.size());
  if (count < 0) {
    ended_ = errno != EINTR && errno != EAGAIN;
    return 0;
  }
  ended_ = count == 0;
  const std::string_view text(chunk.data(), static_cast<std::size_t>(count));
  buffer_ += text;
  return static_cast<std::size_t>(std::ranges::count(text, '\n'));
}

Typed LineInput::take() {
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

}  // namespace dtact::ctl::guided
