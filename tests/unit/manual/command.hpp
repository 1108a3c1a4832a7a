#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace dtact::manual {

/// An option or a positional, as a page or a completion needs it.
struct Argument {
  std::vector<std::string> names;    ///< "-o", "--output"; a positional has one name.
  std::string value;                 ///< Placeholder of the value, "FILE"; empty = a flag.
  std::vector<std::string> choices;  ///< The allowed values; empty = not listed.
  std::string text;                  ///< The sentence of --help.
  /// --help's range, default, needed and excluded options as sentences.
  std::vector<std::string> facts;
  std::vector<std::string> excludes;  ///< Long names of options that may not be given with it.
  bool required = false;
  bool repeats = false;  ///< May be given again.
  bool several = false;  ///< Takes any number of values at once.
};

/// A program or one of its commands.
struct Command {
  std::string name;
  std::string text;    ///< The sentences of --help.
  std::string footer;  ///< Text below the help.
  std::vector<Argument> options;
  std::vector<Argument> positionals;
  std::vector<Command> commands;
};

/// Describes `app` and its commands in the order of --help. A command's own --help is left
/// out, since every command has it.
[[nodiscard]] Command describe(const CLI::App& app);

/// Ends `text` with a full stop unless it ends in another sign, and begins it with a capital unless
/// it begins with a name or value ("depth.npy", "false:").
[[nodiscard]] std::string sentence(std::string text);

}  // namespace dtact::manual
