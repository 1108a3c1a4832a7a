#pragma once

#include <string>
#include <string_view>

using X509 = struct x509_st;  // OpenSSL's

namespace dtact::wire {

/// SHA-256 of the certificate (DER), 64 lower-case hexadecimal digits, as Endpoint.fingerprint says
/// it and clients pin it.
[[nodiscard]] std::string fingerprint(const X509& certificate);

/// What a file of net.tokens has instead of the token: "sha256:" and 64 lower-case hexadecimal
/// digits. One round suffices for a token of 32 random bytes, which nobody can guess.
[[nodiscard]] std::string token_hash(std::string_view token);

}  // namespace dtact::wire
