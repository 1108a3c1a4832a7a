#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "clients/cpp/options.hpp"

namespace dtact::cli {

/// One daemon of a program that serves several, and what it is called there.
struct NamedDaemon {
  std::string name;
  client::Options options;
};

/// Of a daemon's name, bytes.
inline constexpr std::size_t kMaxName = 64;

/// --daemon of a program or command that shows daemons `where`: "on the page", "in the table";
/// `without`: which daemon it is without the option.
void add_daemon_option(CLI::App& app, std::vector<std::string>& values, const std::string& where,
                       const std::string& without = "it is that of --host, named sensor");

/// --find of a program that serves several.
CLI::Option* add_find_option(CLI::App& app, bool& find);

/// Reads the values of `option`:
/// "NAME=ADDRESS[,fingerprint=SHA256][,ca-file=FILE][,token-file=FILE]
/// [,insecure]". What one does not say is as in `common`, but for how the daemon and this program
/// prove who they are. Throws std::runtime_error naming the part that makes no sense or the name
/// that two have, or what client::read_token() does.
[[nodiscard]] std::vector<NamedDaemon> parse_daemons(const std::string& option,
                                                     const std::vector<std::string>& texts,
                                                     const client::Options& common);

}  // namespace dtact::cli
