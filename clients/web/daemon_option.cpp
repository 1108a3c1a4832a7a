#include "clients/web/daemon_option.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <sstream>
#include <stdexcept>

namespace dtact::web {
namespace {

constexpr const char* kForm =
    "NAME=ADDRESS[,fingerprint=SHA256][,ca-file=FILE][,token-file=FILE][,insecure]";

/// It is part of the page's addresses and of Foxglove's topics.
bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= 64 && std::ranges::all_of(name, [](unsigned char sign) {
    return std::isalnum(sign) != 0 || sign == '-' || sign == '_';
  });
}

client::Tls& tls_of(client::Options& options) {
  return options.tls ? *options.tls : options.tls.emplace();
}

}  // namespace

NamedDaemon parse_daemon(const std::string& text, const client::Options& common) {
  std::istringstream parts(text);
  std::string part;
  std::getline(parts, part, ',');
  const auto equals = part.find('=');
  NamedDaemon made{part.substr(0, equals), common};
  if (equals == std::string::npos || equals + 1 == part.size() || !is_name(made.name)) {
    throw std::runtime_error(fmt::format(
        "--daemon {}: it has to be {}, the name of 1 to 64 letters, digits, '-' and '_'", text,
        kForm));
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
          fmt::format("--daemon {}: \"{}\" is not known: it has to be {}", text, part, kForm));
    }
  }
  return made;
}

}  // namespace dtact::web
