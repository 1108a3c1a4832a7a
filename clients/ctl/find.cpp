#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <memory>
#include <ostream>
#include <string>

#include "clients/common/avahi.hpp"
#include "clients/common/exit_codes.hpp"
#include "clients/common/json.hpp"
#include "clients/ctl/online.hpp"

namespace dtact::ctl {
namespace {

std::string line_of(const cli::FoundDaemon& one) {
  const bool v6 = one.address().find(':') != std::string::npos;
  std::string text =
      fmt::format("{}  --host {} --port {}  ({}{}{})  dtactd {}", one.name(), one.address(),
                  one.port(), one.host(), v6 ? ", IPv6" : "",
                  one.serial().empty() ? "" : ", serial " + one.serial(), one.version());
  if (one.tls()) text += "  TLS";
  if (one.token()) text += "  asks for a token";
  return text + '\n';
}

void find(const Context& context, double seconds) {
  const auto all = cli::browse(
      std::chrono::milliseconds(static_cast<std::chrono::milliseconds::rep>(seconds * 1000)));
  for (const auto& one : all) {
    context.out << (context.json ? cli::json_line(one) : line_of(one));
  }
  if (all.empty()) throw cli::Failure(cli::kNotMet, cli::kNoneAnnounced);
}

}  // namespace

void add_find(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand(
      "find", "List the daemons that announce themselves in this network, through avahi-daemon");
  const auto seconds = std::make_shared<double>(3);
  command->add_option("--seconds", *seconds, "Seconds to look at most")
      ->check(cli::positive())
      ->capture_default_str();
  cli::add_json_option(*command, context);
  command->callback([&context, seconds] { find(context, *seconds); });
}

}  // namespace dtact::ctl
