#include "clients/ctl/screen.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdlib>
#include <iostream>
#include <string_view>

#include "clients/common/exit_codes.hpp"

namespace dtact::ctl {

Palette palette_of(const char* term, const char* colorterm) {
  const std::string_view name = term == nullptr ? "" : term;
  const std::string_view colours = colorterm == nullptr ? "" : colorterm;
  if (name.empty() || name == "dumb" || name.ends_with("-mono") || name.starts_with("vt1")) {
    throw cli::Failure(cli::kUsage, "--draw needs a terminal with colours, and TERM is \"" +
                                        std::string(name) + "\": leave it out");
  }
  // What terminals and ssh configurations pass on; see github.com/termstandard/colors.
  return colours == "truecolor" || colours == "24bit" ? Palette::rgb : Palette::xterm256;
}

Screen::Screen() {
  if (::isatty(STDOUT_FILENO) != 1) {
    throw cli::Failure(cli::kUsage,
                       "--draw needs a terminal, and the output is none: leave it out, or take "
                       "`dtactctl snapshot` for a file");
  }
  palette_ = palette_of(std::getenv("TERM"), std::getenv("COLORTERM"));
  // xterm's alternate screen without cursor: what stood there comes back in the end.
  std::cout << "\x1b[?1049h\x1b[?25l\x1b[2J" << std::flush;
}

Screen::~Screen() { std::cout << "\x1b[0m\x1b[?25h\x1b[?1049l" << std::flush; }

Canvas Screen::canvas() const {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) {
    return {80, 24, palette_};
  }
  return {size.ws_col, size.ws_row, palette_};
}

void Screen::show(const std::vector<std::string>& lines) {
  std::string text = "\x1b[H";
  for (std::size_t i = 0; i < lines.size(); ++i) {
    text += lines[i] + "\x1b[K";
    if (i + 1 < lines.size()) text += "\r\n";
  }
  std::cout << text << "\x1b[J" << std::flush;
}

}  // namespace dtact::ctl
