#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <regex>
#include <utility>

#include "tests/unit/manual/pages.hpp"
#include "tests/unit/manual/roff.hpp"

namespace dtact::manual {
namespace {

std::string tag(const Argument& argument) {
  std::string names;
  for (const std::string& name : argument.names) {
    names += (names.empty() ? "" : ", ") + bold(name);
  }
  const std::string value = argument.value.empty() ? "" : " " + italic(argument.value);
  return names + value + (argument.several ? " …" : "");
}

std::string body(const Argument& argument) {
  std::string words = sentence(argument.text);
  for (const std::string& fact : argument.facts) words += " " + fact;
  return escaped(words);
}

std::string list(const std::vector<Argument>& arguments) {
  std::string text;
  for (const Argument& argument : arguments) text += entry(tag(argument), body(argument));
  return text;
}

std::string positional(const Argument& argument) {
  const std::string name = italic(argument.names.at(0)) + (argument.several ? " …" : "");
  return argument.required ? name : "[" + name + "]";
}

/// How a command is called, with a placeholder where details are elsewhere.
std::string usage(const std::string& path, const Command& command) {
  std::string text = bold(path);
  const bool optional =
      std::ranges::any_of(command.options, [](const Argument& a) { return !a.required; });
  for (const Argument& option : command.options) {
    if (option.required) text += " " + bold(option.names.back()) + " " + italic(option.value);
  }
  if (optional) text += " [" + italic("OPTIONS") + "]";
  for (const Argument& argument : command.positionals) text += " " + positional(argument);
  return text;
}

void append_commands(const std::string& path, const Command& parent, std::string& page) {
  for (const Command& command : parent.commands) {
    const std::string name = path.empty() ? command.name : path + " " + command.name;
    // A group's own options are given before its commands.
    if (command.commands.empty() || !command.options.empty()) {
      page += heading(usage(name, command), "SS") + filled(escaped(sentence(command.text)));
      for (const Argument& argument : command.positionals) {
        page += entry(positional(argument), body(argument));
      }
      page += list(command.options);
    }
    append_commands(name, command, page);
  }
}

/// "0 done; 1 failed, or refused" as a list, where each piece begins with its number.
std::string exit_statuses(const std::string& words) {
  static const std::regex piece(R"((\d+) ((?:(?![;,] \d).)*))");
  std::string text;
  for (std::sregex_iterator match(words.begin(), words.end(), piece), end; match != end; ++match) {
    text += entry(bold((*match)[1].str()), escaped(sentence((*match)[2].str())));
  }
  return text;
}

/// The footer's parts, "Environment: …" and "Exit codes: …", as sections.
void append_footer(const std::string& footer, std::string& page) {
  static const std::regex title(R"((?:^|\n)([A-Z][a-z ]+): )");
  const std::sregex_iterator end;
  for (std::sregex_iterator match(footer.begin(), footer.end(), title); match != end;) {
    std::string name = (*match)[1];
    const auto begin = static_cast<std::size_t>(match->position() + match->length());
    ++match;
    const auto length =
        match == end ? std::string::npos : static_cast<std::size_t>(match->position()) - begin;
    std::string words = footer.substr(begin, length);
    std::ranges::replace(words, '\n', ' ');
    if (name.starts_with("Exit")) {
      page += heading("EXIT STATUS") + exit_statuses(words);
    } else {
      std::ranges::transform(name, name.begin(), [](unsigned char sign) {
        return static_cast<char>(std::toupper(sign));
      });
      page += heading(name) + filled(escaped(words));
    }
  }
}

/// The description's first sentence in the form of a page's NAME: "talks to dtactd".
std::string purpose(const std::string& description) {
  const auto end = description.find(".\n");
  std::string text = description.substr(0, end);
  if (text.ends_with('.')) text.pop_back();
  text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
  return text;
}

}  // namespace

std::string program_page(const Command& program, const PageNotes& notes) {
  std::string page = page_head(program.name, notes.section, notes.volume);
  page += heading("NAME") + escaped(program.name) + " \\- " + escaped(purpose(program.text)) + "\n";
  page += heading("SYNOPSIS") + bold(program.name) + " [" + italic("OPTIONS") + "]" +
          (program.commands.empty() ? "" : " " + italic("COMMAND") + " …") + "\n";
  page += heading("DESCRIPTION") + filled(escaped(program.text));
  page += heading("OPTIONS");
  if (!program.commands.empty()) {
    page +=
        filled(escaped("They may come before or after a command; after it `--help` describes "
                       "only that command."));
  }
  page += list(program.options);
  if (!program.commands.empty()) {
    page += heading("COMMANDS");
    append_commands("", program, page);
  }
  append_footer(program.footer, page);
  if (!notes.files.empty()) {
    page += heading("FILES");
    for (const auto& [path, what] : notes.files) page += entry(italic(path), escaped(what));
  }
  page += heading("SEE ALSO");
  std::vector<std::string> others;
  for (const auto& [name, section] : notes.see_also) others.push_back(reference(name, section));
  page += filled(fmt::format("{}", fmt::join(others, ", ")));
  return page;
}

}  // namespace dtact::manual
