#include "clients/ctl/hand_over.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "clients/common/exit_codes.hpp"
#include "clients/common/sibling.hpp"

namespace dtact::ctl {
namespace {

constexpr const char* kProgram = "dtact-calibrate";
/// The global options that a word follows.
constexpr std::array<std::string_view, 5> kWithValue{"--host", "--port", "--token-file",
                                                     "--fingerprint", "--ca-file"};

using Arguments = std::vector<std::string>;

/// The first word from `place` on that is neither an option nor the value of a global one.
Arguments::iterator word_from(Arguments& arguments, Arguments::iterator place) {
  while (place != arguments.end() && place->starts_with('-')) {
    const bool has_value = std::ranges::find(kWithValue, *place) != kWithValue.end();
    if (++place != arguments.end() && has_value) ++place;
  }
  return place;
}

/// Comes back only as a Failure, when dtact-calibrate is neither beside dtactctl nor in PATH.
[[noreturn]] void start_calibrate(Arguments arguments) {
  arguments.insert(arguments.begin(), kProgram);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  ::execvp(cli::sibling(kProgram).c_str(), argv.data());
  const int error = errno;
  throw cli::Failure(
      cli::kFailed,
      fmt::format("cannot start {}, which makes calibrations: {}. It belongs beside dtactctl ({}) "
                  "or into PATH: install it from the same release",
                  kProgram, std::strerror(error), cli::own_folder()));
}

}  // namespace

std::vector<std::string> for_calibrate(std::vector<std::string> arguments) {
  const auto command = word_from(arguments, arguments.begin());
  if (command == arguments.end() || *command != "calibrate") return arguments;
  const auto verb = word_from(arguments, command + 1);
  if (verb != arguments.end() && (*verb == "depth" || *verb == "lens" || *verb == "force")) {
    arguments.erase(command);
  } else {
    *command = "guided";
  }
  return arguments;
}

void add_handed_over(CLI::App& app, const std::vector<std::string>& arguments) {
  const auto add = [&](const char* name, const char* help) {
    CLI::App* command = app.add_subcommand(name, help);
    // All that follows is the other program's, --help included.
    command->allow_extras()->fallthrough(false)->set_help_flag();
    command->callback([&arguments] { start_calibrate(for_calibrate(arguments)); });
  };
  add("calibrate",
      "Make a calibration: guided, or depth, lens or force from images (dtact-calibrate)");
  add("reprocess", "Make the depth of a recording anew with another calibration (dtact-calibrate)");
  add("apply", "Make the depth of an image (dtact-calibrate)");
  add("evaluate", "Compare a calibration with the press of a ball (dtact-calibrate)");
}

}  // namespace dtact::ctl
