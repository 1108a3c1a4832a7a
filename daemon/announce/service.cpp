#include "daemon/announce/service.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cstring>
#include <memory>

namespace dtact::announce {
namespace {

namespace ip = boost::asio::ip;

constexpr std::size_t kMaxTxt = 255;  // bytes of one string, RFC 6763

bool is_same(const ip::address& address, const sockaddr* other) {
  if (other == nullptr) return false;
  if (address.is_v4() && other->sa_family == AF_INET) {
    sockaddr_in v4{};
    std::memcpy(&v4, other, sizeof v4);
    return ntohl(v4.sin_addr.s_addr) == address.to_v4().to_uint();
  }
  if (address.is_v6() && other->sa_family == AF_INET6) {
    sockaddr_in6 v6{};
    std::memcpy(&v6, other, sizeof v6);
    return std::memcmp(v6.sin6_addr.s6_addr, address.to_v6().to_bytes().data(), 16) == 0;
  }
  return false;
}

int interface_of(const ip::address& address) {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return -1;
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all(first, ::freeifaddrs);
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    if (is_same(address, one->ifa_addr)) return static_cast<int>(::if_nametoindex(one->ifa_name));
  }
  return -1;
}

}  // namespace

std::vector<std::string> txt_of(const Facts& facts) {
  std::vector<std::string> txt = {"version=" + facts.version, "serial=" + facts.serial,
                                  "instance=" + facts.instance, facts.tls ? "tls=1" : "tls=0",
                                  facts.token ? "token=1" : "token=0"};
  for (auto& one : txt) one.resize(std::min(one.size(), kMaxTxt));
  return txt;
}

bool is_reachable(const std::string& address) {
  boost::system::error_code error;
  const auto parsed = ip::make_address(address, error);
  return !error && !parsed.is_loopback();
}

void restrict_to(const std::string& address, Service& service) {
  boost::system::error_code error;
  const auto parsed = ip::make_address(address, error);
  if (error) return;
  // "::" takes IPv4, too.
  if (parsed.is_v4()) service.protocol = 0;
  if (parsed.is_unspecified()) return;
  if (parsed.is_v6()) service.protocol = 1;
  service.interface = interface_of(parsed);
}

}  // namespace dtact::announce
