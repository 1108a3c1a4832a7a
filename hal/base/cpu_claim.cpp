#include "hal/base/cpu_claim.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <cstddef>

namespace dtact::base {
namespace {

/// A socket bound to the abstract address `name`; empty when the address is in use.
UniqueFd bound(const std::string& name) {
  UniqueFd fd(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // The first byte stays 0, which makes the address abstract.
  const std::size_t size = name.copy(address.sun_path + 1, sizeof address.sun_path - 1);
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + size);
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), length) != 0) return {};
  return fd;
}

}  // namespace

CpuClaim::CpuClaim(const cpu_set_t& cpus, const std::string& name) {
  // More daemons on one CPU than this share it without a claim.
  constexpr int kMaxClaims = 16;
  for (int claims = 0; claims < kMaxClaims && !claim_; ++claims) {
    for (int cpu = CPU_SETSIZE - 1; cpu >= 0 && !claim_; --cpu) {
      if (!CPU_ISSET(static_cast<std::size_t>(cpu), &cpus)) continue;
      cpu_ = cpu;
      claim_ = bound(fmt::format("{}-{}-{}", name, cpu, claims));
    }
  }
}

}  // namespace dtact::base
