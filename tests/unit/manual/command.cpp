#include "tests/unit/manual/command.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <regex>
#include <set>
#include <sstream>

namespace dtact::manual {
namespace {

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, at);) parts.push_back(part);
  return parts;
}

/// Sorted by name: CLI11 keeps pointers, whose order differs between processes.
/// Only options need and exclude each other.
std::vector<std::string> names_of(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) names.push_back("--" + option->get_lnames().at(0));
  std::ranges::sort(names);
  return names;
}

/// Parses CLI11's text behind an option's type, as in "FLOAT:FLOAT in [0.1 - 100]".
void read_check(const std::string& check, Argument& argument) {
  static const std::regex range(R"(\S+ in \[(\S+) - (\S+)\])");
  std::smatch match;
  if (std::regex_match(check, match, range)) {
    argument.facts.push_back(fmt::format("{} … {}.", match[1].str(), match[2].str()));
  } else if (check == "POSITIVE") {
    argument.facts.emplace_back("Above 0.");
  } else if (check == "NONNEGATIVE") {
    argument.facts.emplace_back("Not below 0.");
  } else if (check == "DIR") {
    argument.value = "FOLDER";
  } else if (check.starts_with('{') && check.ends_with('}')) {
    argument.choices = split(check.substr(1, check.size() - 2), ',');
    argument.value = fmt::format("{}", fmt::join(argument.choices, "|"));
  } else {
    argument.value = check;
  }
}

/// The name of a value. CLI11's types of numbers mean nothing to users.
std::string value_of(const std::string& type) {
  return type == "UINT" || type == "INT" || type == "FLOAT" ? "NUMBER" : type;
}

Argument describe(const CLI::Option& option) {
  Argument argument;
  argument.text = option.get_description();
  argument.required = option.get_required();
  for (const std::string& name : option.get_snames()) argument.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) argument.names.push_back("--" + name);
  if (option.get_positional()) argument.names = {option.get_name(true)};
  if (option.get_items_expected_max() > 0) {
    const std::vector<std::string> types = split(option.get_type_name(), ':');
    argument.value = value_of(types.at(0));
    for (std::size_t i = 1; i < types.size(); ++i) read_check(types[i], argument);
    argument.repeats = option.get_expected_max() >= CLI::detail::expected_max_vector_size;
    argument.several = argument.repeats && option.get_allow_extra_args();
    if (!option.get_default_str().empty()) {
      argument.facts.push_back(fmt::format("Default: {}.", option.get_default_str()));
    }
  }
  argument.excludes = names_of(option.get_excludes());
  if (const auto needed = names_of(option.get_needs()); !needed.empty()) {
    argument.facts.push_back(fmt::format("Only with {}.", fmt::join(needed, " and ")));
  }
  if (!argument.excludes.empty()) {
    argument.facts.push_back(fmt::format("Not with {}.", fmt::join(argument.excludes, ", ")));
  }
  return argument;
}

Command describe(const CLI::App& app, bool is_command) {
  Command command{app.get_name(), app.get_description(), app.get_footer(), {}, {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    if (is_command && option == app.get_help_ptr()) continue;
    (option->get_positional() ? command.positionals : command.options).push_back(describe(*option));
  }
  for (const CLI::App* below : app.get_subcommands(std::function<bool(const CLI::App*)>())) {
    command.commands.push_back(describe(*below, true));
  }
  return command;
}

}  // namespace

Command describe(const CLI::App& app) { return describe(app, false); }

std::string sentence(std::string text) {
  if (text.empty()) return text;
  const auto letter = [](unsigned char sign) { return std::isalpha(sign) != 0; };
  const auto end = std::ranges::find_if_not(text, letter);
  if (end != text.begin() && (end == text.end() || *end == ' ' || *end == ',' || *end == ';')) {
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  }
  if (std::string(".!?:").find(text.back()) == std::string::npos) text += '.';
  return text;
}

}  // namespace dtact::manual
