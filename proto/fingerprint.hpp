#pragma once

#include <string>

using X509 = struct x509_st;  // OpenSSL's

namespace dtact::wire {

/// SHA-256 of the certificate (DER), 64 lower-case hexadecimal digits, as Endpoint.fingerprint says
/// it and clients pin it.
[[nodiscard]] std::string fingerprint(const X509& certificate);

}  // namespace dtact::wire
