#include "tests/unit/manual/roff.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <sstream>

namespace dtact::manual {

std::string escaped(std::string_view text) {
  std::string result;
  bool code = false;
  for (const char sign : text) {
    switch (sign) {
      case '\\':
        result += "\\e";
        break;
      case '-':
        result += "\\-";
        break;
      // Unescaped these print an accent, a dash and a typographic quotation mark: groff_char(7).
      case '^':
        result += "\\(ha";
        break;
      case '~':
        result += "\\(ti";
        break;
      case '\'':
        result += "\\(aq";
        break;
      case '`':
        code = !code;
        result += code ? "\\fB" : "\\fR";
        break;
      default:
        result += sign;
    }
  }
  return result;
}

std::string bold(std::string_view text) { return "\\fB" + escaped(text) + "\\fR"; }
std::string italic(std::string_view text) { return "\\fI" + escaped(text) + "\\fR"; }

std::string filled(const std::string& words) {
  constexpr std::size_t kColumns = 80;
  std::string result;
  std::string line;
  std::istringstream stream(words);
  for (std::string word; stream >> word;) {
    if (!line.empty() && line.size() + 1 + word.size() > kColumns) {
      result += line + '\n';
      line.clear();
    }
    if (!line.empty()) line += ' ';
    // A line that begins with a full stop would be a request.
    if (line.empty() && word.starts_with('.')) line += "\\&";
    line += word;
  }
  return result + line + '\n';
}

std::string page_head(const std::string& name, int section, const std::string& volume) {
  std::string title = name;
  std::ranges::transform(title, title.begin(),
                         [](unsigned char sign) { return static_cast<char>(std::toupper(sign)); });
  return fmt::format(
      ".\\\" Made by ./dev man from what the programs say of themselves; change it there.\n"
      ".TH {} {} \"\" dtactd \"{}\"\n",
      escaped(title), section, volume);
}

std::string heading(const std::string& title, const char* macro) {
  return fmt::format(".{} \"{}\"\n", macro, title);
}

std::string entry(const std::string& tag, const std::string& body) {
  return fmt::format(".TP\n{}\n{}", tag, filled(body));
}

std::string reference(const std::string& name, int section) {
  return fmt::format("{}({})", bold(name), section);
}

}  // namespace dtact::manual
