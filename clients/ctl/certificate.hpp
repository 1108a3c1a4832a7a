#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace dtact::ctl {

/// A key on P-256 and a certificate that it signed itself, both as PEM.
struct Pair {
  std::string certificate;
  std::string key;
};

/// `names`: what clients may call the machine, host names and addresses, at least one; the first is
/// the subject. Good for ten years. Throws std::runtime_error naming what is neither a host name
/// nor an address.
[[nodiscard]] Pair make_pair(const std::vector<std::string>& names);

/// This machine's name, the same with ".local" (mDNS) and its addresses but for those that only one
/// link knows, loopback's among them.
[[nodiscard]] std::vector<std::string> own_names();

/// See wire::fingerprint(). `pem`: its first certificate. Throws std::runtime_error when there is
/// none.
[[nodiscard]] std::string fingerprint_of(std::string_view pem);

}  // namespace dtact::ctl
