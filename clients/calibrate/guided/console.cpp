#include "clients/calibrate/guided/console.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <iostream>
#include <ostream>
#include <sstream>
#include <string_view>
#include <utility>

#include "clients/calibrate/guided/preview.hpp"
#include "clients/common/guided.pb.h"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"

namespace dtact::ctl::guided {
namespace {

std::string trimmed(const std::string& text) {
  constexpr const char* kBlanks = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

/// Width of an image in the terminal.
constexpr int kColumns = 44;

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

std::string text_of(const Prompt& prompt) {
  std::string text = prompt.text;
  for (const Answer& answer : prompt.answers) {
    if (!text.empty()) text += &answer == &prompt.answers.front() ? "\n" : "  ";
    text += fmt::format("[{}] {}", answer.key.empty() ? "Enter" : answer.key, answer.words);
  }
  return text;
}

StreamConsole::StreamConsole(int in, std::ostream& out, bool interactive,
                             std::function<bool()> interrupted)
    : in_(in), out_(out), interactive_(interactive), interrupted_(std::move(interrupted)) {}

StreamConsole::~StreamConsole() {
  clear_live();
  out_.flush();
}

void StreamConsole::fetch() {
  const std::size_t lines = in_.fetch();
  // The terminal has echoed them: the cursor is as many lines below the live lines.
  if (live_lines_ > 0) live_lines_ += lines;
}

Typed StreamConsole::typed() {
  if (interrupted_()) return {Typed::Kind::interrupted, {}};
  fetch();
  return in_.take();
}

void StreamConsole::say(const std::string& text) {
  clear_live();
  out_ << text;
  if (text.empty() || text.back() != '\n') out_ << '\n';
  out_.flush();
}

void StreamConsole::keep(const image::Grey8& picture) {
  if (!interactive_) return;
  std::string text;
  for (const std::string& line : half_blocks(picture, kColumns)) text += line + "\n";
  say(text);
}

void StreamConsole::live(const Scene& scene) {
  if (!interactive_) return;
  std::vector<std::string> lines;
  if (scene.picture != nullptr) lines = half_blocks(*scene.picture, kColumns);
  if (!scene.words.empty()) lines.push_back(scene.words);
  if (!scene.prompt.answers.empty()) {
    std::istringstream prompt(text_of(scene.prompt) + " > ");
    for (std::string line; std::getline(prompt, line);) lines.push_back(line);
  }
  if (lines.empty()) return;
  clear_live();
  // Disables wrapping: a line that is too long for the terminal must not become two.
  out_ << "\x1b[?7l";
  for (std::size_t i = 0; i < lines.size(); ++i) out_ << (i > 0 ? "\n" : "") << lines[i];
  out_ << "\x1b[?7h" << std::flush;
  live_lines_ = lines.size();
}

void StreamConsole::clear_live() {
  if (live_lines_ == 0) return;
  fetch();  // input meanwhile has moved the cursor
  out_ << '\r';
  if (live_lines_ > 1) out_ << "\x1b[" << live_lines_ - 1 << 'A';
  out_ << "\x1b[J";
  live_lines_ = 0;
}

JsonConsole::JsonConsole(int in, std::ostream& out, std::function<bool()> interrupted)
    : in_(in), out_(out), interrupted_(std::move(interrupted)) {}

Typed JsonConsole::typed() {
  if (interrupted_()) return {Typed::Kind::interrupted, {}};
  (void)in_.fetch();
  return in_.take();
}

void JsonConsole::say(const std::string& text) {
  cli::GuidedLine line;
  line.set_text(text);
  out_ << cli::json_line(line) << std::flush;
}

void JsonConsole::live(const Scene& scene) {
  cli::GuidedLine line;
  cli::GuidedScene& reported = *line.mutable_scene();
  if (scene.picture != nullptr) reported.set_picture_png(image::encode_png(*scene.picture));
  reported.set_mm_per_px(scene.mm_per_px);
  reported.set_words(scene.words);
  reported.set_prompt(scene.prompt.text);
  for (const Answer& answer : scene.prompt.answers) {
    cli::GuidedAnswer& added = *reported.add_answers();
    added.set_key(answer.key);
    added.set_words(answer.words);
  }
  for (const CapturedPress& press : scene.presses) {
    cli::GuidedPress& added = *reported.add_presses();
    added.set_name(press.name);
    added.set_col(press.col);
    added.set_row(press.row);
    added.set_radius_px(press.radius_px);
    added.set_depth_mm(press.depth_mm);
  }
  reported.set_covered_mm(scene.covered_mm);
  reported.set_presses_required(static_cast<std::uint32_t>(scene.presses_required));
  out_ << cli::json_line(line) << std::flush;
}

std::unique_ptr<Console> make_console(const cli::Context& context) {
  if (context.json) {
    return std::make_unique<JsonConsole>(STDIN_FILENO, context.out, cli::Interruptible::happened);
  }
  const bool terminal =
      &context.out == &std::cout && ::isatty(STDOUT_FILENO) == 1 && ::isatty(STDIN_FILENO) == 1;
  return std::make_unique<StreamConsole>(STDIN_FILENO, context.out, terminal,
                                         cli::Interruptible::happened);
}

}  // namespace dtact::ctl::guided
