#include "clients/common/daemon_option.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <sstream>
#include <stdexcept>

namespace dtact::cli {
namespace {

constexpr const char* kForm =
    "NAME=ADDRESS[,fingerprint=SHA256][,ca-file=FILE][,token-file=FILE][,insecure]";

/// It is part of the page's addresses and of topics.
bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= kMaxName &&
         std::ranges::all_of(name, [](unsigned char sign) {
           return std::isalnum(sign) != 0 || sign == '-' || sign == '_';
         });
}

client::Tls& tls_of(client::Options& options) {
  return options.tls ? *options.tls : options.tls.emplace();
}

NamedDaemon parse(const std::string& option, const std::string& text,
                  const client::Options& common) {
  std::istringstream parts(text);
  std::string part;
  std::getline(parts, part, ',');
  const auto equals = part.find('=');
  NamedDaemon made{part.substr(0, equals), common};
  if (equals == std::string::npos || equals + 1 == part.size() || !is_name(made.name)) {
    throw std::runtime_error(
        fmt::format("{} {}: it has to be {}, the name of 1 to 64 letters, digits, '-' and '_'",
                    option, text, kForm));
  }
  client::Options& options = made.options;
  options.host = part.substr(equals + 1);
  options.tls.reset();
  options.token.clear();
  options.insecure = false;
  while (std::getline(parts, part, ',')) {
    const auto at = part.find('=');
    const std::string key = part.substr(0, at);
    const std::string value = at == std::string::npos ? "" : part.substr(at + 1);
    if (key == "fingerprint" && !value.empty()) {
      tls_of(options).fingerprint = value;
    } else if (key == "ca-file" && !value.empty()) {
      tls_of(options).ca_file = value;
    } else if (key == "token-file" && !value.empty()) {
      options.token = client::read_token(value);
    } else if (part == "insecure") {
      options.insecure = true;
    } else {
      throw std::runtime_error(
          fmt::format("{} {}: \"{}\" is not known: it has to be {}", option, text, part, kForm));
    }
  }
  return made;
}

}  // namespace

void add_daemon_option(CLI::App& app, std::vector<std::string>& values, const std::string& where,
                       const std::string& without) {
  CLI::Option* const daemons =
      app.add_option(
             "--daemon", values,
             "A daemon and its name " + where +
                 "; behind the address, each after a comma, what it is connected to with: "
                 "fingerprint=SHA256, ca-file=FILE, token-file=FILE, insecure. Without one " +
                 without)
          ->type_name("NAME=ADDRESS")
          ->take_all();
  // Those are about the one daemon of --host.
  for (const char* one :
       {"--host", "--port", "--token-file", "--fingerprint", "--ca-file", "--insecure"}) {
    if (CLI::Option* const other = app.get_option_no_throw(one)) daemons->excludes(other);
  }
}

CLI::Option* add_find_option(CLI::App& app, bool& find) {
  return app
      .add_flag("--find", find,
                "All daemons that announce themselves in this network through avahi-daemon, "
                "besides those of --daemon, named MACHINE_NAME; where they ask for TLS and a "
                "token, --ca-file and --token-file are for all of them")
      ->excludes("--host", "--port", "--fingerprint", "--insecure");
}

std::vector<NamedDaemon> parse_daemons(const std::string& option,
                                       const std::vector<std::string>& texts,
                                       const client::Options& common) {
  std::vector<NamedDaemon> daemons;
  daemons.reserve(texts.size());
  std::set<std::string> names;
  for (const std::string& text : texts) {
    daemons.push_back(parse(option, text, common));
    if (!names.insert(daemons.back().name).second) {
      throw std::runtime_error(fmt::format("{}: two are named {}: each needs a name of its own",
                                           option, daemons.back().name));
    }
  }
  return daemons;
}

}  // namespace dtact::cli
