#include "clients/calibrate/guided/console.hpp"

#include <fmt/format.h>

#include <ostream>
#include <sstream>
#include <utility>

#include "clients/calibrate/guided/preview.hpp"

namespace dtact::ctl::guided {
namespace {

/// Of a picture in the terminal.
constexpr int kColumns = 44;

}  // namespace

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
  // The terminal has echoed them: the cursor stands so much below the live lines.
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
