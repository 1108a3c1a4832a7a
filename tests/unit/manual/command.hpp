#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace dtact::manual {

/// An option or a positional, as a page or a completion needs it.
struct Argument {
  std::vector<std::string> names;    ///< "-o", "--output"; of a positional its one name.
  std::string value;                 ///< What stands for the value, "FILE"; empty = a flag.
  std::vector<std::string> choices;  ///< The only values there are; empty = not so few.
  std::string text;                  ///< The sentence of --help.
  /// What --help says in signs, as sentences: range, default, what it needs and excludes.
  std::vector<std::string> facts;
  std::vector<std::string> excludes;  ///< Long names of options that may not stand beside it.
  bool required = false;
  bool repeats = false;  ///< May be given again.
  bool several = false;  ///< Takes any number of values at once.
};

/// A program or one of its commands.
struct Command {
  std::string name;
  std::string text;    ///< The sentences of --help.
  std::string footer;  ///< What stands below the help.
  std::vector<Argument> options;
  std::vector<Argument> positionals;
  std::vector<Command> commands;
};

/// What --help is made of: of `app` and its commands, in its order. A command's own --help is left
/// out, since every command has it.
[[nodiscard]] Command describe(const CLI::App& app);

/// `text` with a full stop, where it ends in no sign of its own, and with a capital, where it
/// begins with a word and not with a name or value ("depth.npy", "false:").
[[nodiscard]] std::string sentence(std::string text);

}  // namespace dtact::manual
