#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <memory>
#include <ostream>
#include <system_error>

#include "clients/ctl/secrets.hpp"

namespace dtact::ctl {
namespace {

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

}  // namespace

void add_token(CLI::App& app, Context& context) {
  CLI::App* command =
      app.add_subcommand("token", "Make a line for the daemon's token file (needs no daemon)");
  struct Arguments {
    std::string rights;
    std::string name;
  };
  const auto arguments = std::make_shared<Arguments>();
  command->add_option("--new", arguments->rights, "What its holder may do")
      ->required()
      ->check(CLI::IsMember({"view", "control", "calibrate"}));
  command->add_option("--name", arguments->name, "What the daemon's log calls it, without blanks")
      ->check(CLI::Validator(
          [](const std::string& name) {
            const bool printable =
                std::all_of(name.begin(), name.end(), [](char c) { return c > ' ' && c < 0x7f; });
            return printable ? std::string() : std::string("only printable ASCII without blanks");
          },
          "NAME"));
  command->callback([arguments, &context] {
    context.out << fmt::format("{} {}{}{}\n", arguments->rights, random_token(),
                               arguments->name.empty() ? "" : " ", arguments->name);
  });
}

}  // namespace dtact::ctl
