#include "clients/web/names.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/address.hpp>
#include <cctype>

namespace dtact::web {
namespace {

/// Of ASCII, as in host names.
bool iequals(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

}  // namespace

std::string_view without_port(std::string_view host) {
  if (host.starts_with('[')) {
    const auto end = host.find(']');
    return end == std::string_view::npos ? "" : host.substr(1, end - 1);
  }
  return host.substr(0, host.find(':'));
}

bool is_own_host(std::string_view host, const std::vector<std::string>& names) {
  const std::string_view name = without_port(host);
  boost::system::error_code error;
  (void)boost::asio::ip::make_address(std::string(name), error);
  if (!error || iequals(name, "localhost")) return true;
  return !name.empty() && std::ranges::any_of(names, [&](const std::string& own) {
    return iequals(name, without_port(own));
  });
}

bool is_own_origin(std::string_view origin, std::string_view host, bool tls,
                   const std::vector<std::string>& others) {
  // A proxy may end TLS before this gateway.
  for (const std::string_view scheme : {"https://", "http://"}) {
    if (tls && scheme == "http://") continue;
    if (origin.starts_with(scheme) && iequals(origin.substr(scheme.size()), host)) return true;
  }
  return std::ranges::find(others, origin) != others.end();
}

std::vector<std::string> machine_names() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0 || name[0] == '\0') return {};
  return {name.data(), std::string(name.data()) + ".local"};
}

}  // namespace dtact::web
