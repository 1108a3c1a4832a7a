#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <system_error>

#include "clients/ctl/secrets.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

/// 32 random bytes in hexadecimal, which no shell and no file format takes for anything else.
std::string random_token() {
  std::array<unsigned char, 32> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw std::system_error(errno, std::generic_category(), "no random numbers");
  }
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

std::string new_token_in(const fs::path& file) {
  if (fs::exists(fs::symlink_status(file))) {
    throw std::runtime_error(fmt::format(
        "{} is there already, and a client may use it: choose another name", file.string()));
  }
  const std::string token = random_token();
  base::write_file_atomically(file, token + "\n", 0600);
  return token;
}

const std::string& known_token(const client::Options& target) {
  // One SHA-256 keeps no secret that can be guessed.
  constexpr std::size_t kMinBytes = 32;
  if (target.token.size() < kMinBytes) {
    throw std::runtime_error(fmt::format(
        "the token of --token-file has {} bytes, its hash would reveal one with fewer than {}: "
        "--new makes another",
        target.token.size(), kMinBytes));
  }
  return target.token;
}

}  // namespace

void add_token(CLI::App& app, Context& context) {
  CLI::App* command = app.add_subcommand(
      "token", "Make a token for a client, and the line of the daemon's token file that admits it");
  struct Arguments {
    std::string fresh;
    std::string hash;
    std::string name;
    fs::path file;
  };
  const auto arguments = std::make_shared<Arguments>();
  const CLI::IsMember rights({"view", "control", "calibrate"});
  CLI::Option* fresh =
      command
          ->add_option("--new", arguments->fresh, "Make a token whose holder may do this, into -o")
          ->check(rights);
  CLI::Option* file =
      command
          ->add_option("-o,--output", arguments->file,
                       "File for the client's --token-file: the token is nowhere else")
          ->type_name("FILE")
          ->needs(fresh);
  fresh->needs(file);
  CLI::Option* hash = command
                          ->add_option("--hash", arguments->hash,
                                       "Only print the line for the token of --token-file")
                          ->check(rights)
                          ->excludes(fresh);
  command->add_option("--name", arguments->name, "What the daemon's log calls it, without blanks")
      ->check(CLI::Validator(
          [](const std::string& name) {
            const bool printable =
                std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < 0x7f; });
            return printable ? std::string() : std::string("only printable ASCII without blanks");
          },
          "NAME"));
  command->callback([arguments, fresh, hash, &context] {
    if (fresh->count() + hash->count() == 0) throw CLI::RequiredError("--new or --hash");
    const std::string token =
        arguments->hash.empty() ? new_token_in(arguments->file) : known_token(context.target);
    context.out << fmt::format("{}{} {}{}{}\n", arguments->fresh, arguments->hash,
                               wire::token_hash(token), arguments->name.empty() ? "" : " ",
                               arguments->name);
  });
}

}  // namespace dtact::ctl
