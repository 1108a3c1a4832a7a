#include "clients/cpp/address.hpp"

#include <fmt/format.h>
#include <sys/un.h>

#include <algorithm>
#include <charconv>
#include <string_view>

#include "clients/cpp/errors.hpp"

namespace dtact::client {
namespace {

constexpr std::string_view kUnix = "unix:";
/// With the zero at its end (unix(7)).
constexpr std::size_t kMaxUnixPath = sizeof(sockaddr_un::sun_path) - 1;

[[noreturn]] void refuse(const std::string& text) {
  throw Error(fmt::format(
      "\"{}\" is no address of a daemon: give HOST, HOST:PORT, [IPV6]:PORT or unix:/PATH, with a "
      "port of 1 to 65535 and a path of at most {} bytes",
      text, kMaxUnixPath));
}

}  // namespace

std::string Address::name() const {
  return unix_path.empty() ? fmt::format("{} port {}", host, port)
                           : fmt::format("unix:{}", unix_path);
}

Address parse_address(const std::string& text, std::uint16_t port) {
  const std::string_view all = text;
  if (all.starts_with(kUnix)) {
    const std::string_view path = all.substr(kUnix.size());
    if (!path.starts_with('/') || path.size() > kMaxUnixPath) refuse(text);
    return {std::string(path), "", 0};
  }
  std::string_view host = all;
  std::string_view number;
  bool numbered = false;
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    if (end == std::string_view::npos) refuse(text);
    number = host.substr(end + 1);
    host = host.substr(1, end - 1);
    if (!number.empty() && !number.starts_with(':')) refuse(text);
    numbered = !number.empty();
    if (numbered) number.remove_prefix(1);
  } else if (std::ranges::count(host, ':') == 1) {  // more of them: IPv6 without a port
    numbered = true;
    number = host.substr(host.find(':') + 1);
    host = host.substr(0, host.find(':'));
  }
  if (numbered) {
    const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), port);
    if (error != std::errc{} || end != number.data() + number.size()) refuse(text);
  }
  if (host.empty() || port == 0) refuse(text);
  return {"", std::string(host), port};
}

}  // namespace dtact::client
