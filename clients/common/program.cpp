#include "clients/common/program.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <ostream>
#include <sstream>
#include <string_view>
#include <utility>

#include "clients/common/exit_codes.hpp"
#include "hal/base/utf8.hpp"
#include "version.hpp"

namespace dtact::cli {
namespace {

int parse(CLI::App& app, std::vector<std::string> arguments, std::ostream& out,
          std::ostream& error) {
  try {
    // CLI11 takes them from the back.
    std::ranges::reverse(arguments);
    app.parse(std::move(arguments));
    if (!out.flush()) {
      throw Failure(kFailed, "the output could not be written: is the disk full?");
    }
    return kOk;
  } catch (const CLI::RequiredError& e) {
    const std::vector<std::string> left = app.remaining();
    if (left.empty() || !app.get_subcommands().empty()) {
      (void)app.exit(e, out, error);
      return kUsage;
    }
    error << app.get_name() << ": \"" << left.front() << "\" is no command; known are ";
    const char* between = "";
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
      error << std::exchange(between, ", ") << command->get_name();
    }
    error << '\n';
    return kUsage;
  } catch (const CLI::ParseError& e) {
    // Also --help and --version, with exit code 0.
    return app.exit(e, out, error) == 0 ? kOk : kUsage;
  }
}

/// A word as a shell takes it.
std::string shell_word(const std::string& word) {
  constexpr std::string_view kPlain = "-_./:,@%+=";
  const bool plain = !word.empty() && std::ranges::all_of(word, [&](unsigned char c) {
    return std::isalnum(c) != 0 || kPlain.find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (plain) return word;
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

std::string options_of(const CLI::App& app) {
  std::string text;
  for (const std::string& word : given_options(app)) {
    text += " " + (word.starts_with("--") ? word : shell_word(word));
  }
  return text;
}

CLI::Validator number_check(double least, double most, const std::string& described) {
  return {[least, most](std::string& text) {
            double value = 0;
            const bool is_number = CLI::detail::lexical_cast(text, value);
            if (is_number && value >= least && value <= most) return std::string();
            return fmt::format("{} is no number from {} to {}", text, least, most);
          },
          described};
}

}  // namespace

CLI::Validator in_range(double least, double most) {
  return number_check(least, most, fmt::format("FLOAT in [{} - {}]", least, most));
}

CLI::Validator positive() { return number_check(1e-9, 1e9, "POSITIVE"); }

std::vector<std::string> given_options(const CLI::App& app) {
  std::vector<std::string> words;
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0 || option->get_positional()) continue;
    words.push_back(option->get_name());
    if (option->get_items_expected_max() == 0) continue;
    words.push_back(fmt::format("{}", fmt::join(option->results(), ",")));
  }
  return words;
}

std::string command_line(const CLI::App& command) {
  std::string text = " " + command.get_name() + options_of(command);
  for (const CLI::App* app = command.get_parent(); app != nullptr; app = app->get_parent()) {
    text.insert(0, " " + app->get_name() + options_of(*app));
  }
  return text.substr(1);
}

void add_global_options(CLI::App& app, Context& context) {
  const std::string name = app.get_name() + " " DTACT_VERSION;
  app.set_version_flag("--version", name);
  app.footer(kExitCodesHelp);
  app.require_subcommand(1);
  app.fallthrough();  // global options may stand behind the command
  context.target.program = name;
  client::Options& target = context.target;
  app.add_option("--host", target.host,
                 "Name or address of the daemon's machine, also with :PORT, or unix:/PATH")
      ->type_name("HOST")
      ->capture_default_str();
  app.add_option("--port", target.port, "TCP port of the daemon")
      ->capture_default_str()
      ->check(CLI::Range(1, 65535));
  app.add_option_function<std::string>(
         "--token-file",
         [&target](const std::string& file) { target.token = client::read_token(file); },
         "The token that the daemon asks for: the file's first line")
      ->type_name("FILE");
  const auto tls = [&target]() -> client::Tls& {
    return target.tls.has_value() ? *target.tls : target.tls.emplace();
  };
  app.add_option_function<std::string>(
         "--fingerprint", [tls](const std::string& digits) { tls().fingerprint = digits; },
         "Use TLS, and only with the daemon of this certificate (dtactctl cert --show prints it)")
      ->type_name("SHA256");
  app.add_option_function<std::string>(
         "--ca-file", [tls](const std::string& file) { tls().ca_file = file; },
         "Use TLS, and only with a certificate signed by one of these")
      ->type_name("FILE");
  app.add_flag("--insecure", target.insecure,
               "Send the token over plain TCP to another machine, where others may read it");
}

CLI::Option* add_json_option(CLI::App& command, Context& context) {
  return command.add_flag("--json", context.json, "Print JSON, one object a line");
}

int run(CLI::App& app, std::vector<std::string> arguments, std::ostream& out, std::ostream& error) {
  const auto fail = [&](const std::exception& e, ExitCode code) {
    out.flush();
    error << app.get_name() << ": ";
    // A daemon's answer may be among them.
    std::istringstream lines(e.what());
    for (std::string line; std::getline(lines, line);) error << base::printable(line) << '\n';
    return code;
  };
  try {
    return parse(app, std::move(arguments), out, error);
  } catch (const Failure& e) {
    return fail(e, e.code());
  } catch (const client::ConnectionError& e) {
    return fail(e, kNoConnection);
  } catch (const std::exception& e) {
    return fail(e, kFailed);
  }
}

}  // namespace dtact::cli
