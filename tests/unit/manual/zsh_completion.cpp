#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "tests/unit/manual/pages.hpp"

namespace dtact::manual {
namespace {

/// The text in single quotes, as one word of a shell.
std::string in_quotes(const std::string& text) {
  std::string result = "'";
  for (const char sign : text)
    result += sign == '\'' ? std::string(R"('\'')") : std::string(1, sign);
  return result + "'";
}

std::string with_backslashes(const std::string& text, const std::string& signs) {
  std::string result;
  for (const char sign : text) {
    if (signs.find(sign) != std::string::npos) result += '\\';
    result += sign;
  }
  return result;
}

/// The action that completes a value: zshcompsys(1), _arguments. A blank only shows the name.
std::string action(const Argument& argument) {
  if (!argument.choices.empty()) return fmt::format("({})", fmt::join(argument.choices, " "));
  if (argument.value == "FILE") return "_files";
  if (argument.value == "FOLDER") return "_files -/";
  if (argument.value == "HOST") return "_hosts";
  return " ";
}

std::string value(const Argument& argument, const std::string& name) {
  return ":" + with_backslashes(name, ":\\") + ":" + action(argument);
}

/// An option as _arguments reads it, one word a name.
std::string option_spec(const Argument& option) {
  const std::string text = "[" + with_backslashes(option.text, "[]\\") + "]" +
                           (option.value.empty() ? "" : value(option, option.value));
  std::vector<std::string> others = option.excludes;
  // An option that ends the program stands alone.
  const bool ends = option.names.back() == "--help" || option.names.back() == "--version";
  if (ends) others = {"-", "*"};
  if (!option.repeats && !ends) {
    others.insert(others.end(), option.names.begin(), option.names.end());
  }
  const std::string before = option.repeats ? "*" : fmt::format("({})", fmt::join(others, " "));
  std::string words;
  for (const std::string& name : option.names) {
    // Its value may also follow without a blank.
    const char* joined = option.value.empty() ? "" : name.starts_with("--") ? "=" : "+";
    std::string flat = fmt::format("{}{}{}{}", before, name, joined, text);
    std::ranges::replace(flat, '\n', ' ');
    words.append(" \\\n    ").append(in_quotes(flat));
  }
  return words;
}

std::string specs(const Command& command) {
  std::string words;
  for (const Argument& option : command.options) words += option_spec(option);
  for (const Argument& argument : command.positionals) {
    words += " \\\n    " + in_quotes(value(argument, argument.names.at(0)));
  }
  return words;
}

/// The function for a program or command with commands below it, whose functions come first.
/// `locals`: its first lines, which the functions below see.
std::string function(const std::string& name, const Command& command, const std::string& locals) {
  std::string before;
  std::string list;
  std::string cases;
  for (const Command& below : command.commands) {
    list += "\n        " + in_quotes(below.name + ":" + below.text);
    std::string what = "_arguments -s $everywhere" + specs(below);
    if (!below.commands.empty()) {
      what = name + "_" + below.name;
      const std::string options =
          below.options.empty() ? "" : fmt::format("  everywhere+=({}\n  )\n", specs(below));
      before += function(what, below, options) + "\n";
    }
    cases += fmt::format("        {}) {} ;;\n", below.name, what);
  }
  return before + fmt::format(R"({}() {{
{}  local curcontext=$curcontext state line
  typeset -A opt_args
  _arguments -s -C $everywhere ':command:->command' '*::argument:->argument' && return
  case $state in
    command)
      local -a commands=({}
      )
      _describe -t commands command commands ;;
    argument)
      case $words[1] in
{}      esac ;;
  esac
}}
)",
                              name, locals, list, cases);
}

}  // namespace

std::string zsh_completion(const Command& program) {
  const std::string name = "_" + program.name;
  std::string text = "#compdef " + program.name +
                     "\n# Made by ./dev man from the program's --help; change it there.\n\n";
  if (program.commands.empty()) {
    text += fmt::format("{}() {{\n  _arguments -s{}\n}}\n", name, specs(program));
  } else {
    text +=
        function(name, program, fmt::format("  local -a everywhere=({}\n  )\n", specs(program)));
  }
  return text + "\n" + name + " \"$@\"\n";
}

}  // namespace dtact::manual
