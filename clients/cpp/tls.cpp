#include "clients/cpp/tls.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/x509v3.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <system_error>
#include <utility>

#include "clients/cpp/errors.hpp"

namespace dtact::client {
namespace {

constexpr std::size_t kFingerprintDigits = 64;

/// Lower case without colons, as `openssl x509 -fingerprint` and `dtactctl cert` differ.
std::string plain(const std::string& fingerprint) {
  std::string digits;
  for (const char c : fingerprint) {
    if (c != ':') digits += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  const auto is_digit = [](char c) { return std::isxdigit(static_cast<unsigned char>(c)) != 0; };
  if (digits.size() != kFingerprintDigits || !std::ranges::all_of(digits, is_digit)) {
    throw Error(fmt::format(
        "\"{}\" is no fingerprint: it has {} hexadecimal digits, as dtactctl cert --show "
        "prints them on the daemon's machine",
        fingerprint, kFingerprintDigits));
  }
  return digits;
}

std::string last_reason() {
  const unsigned long error = ::ERR_peek_last_error();
  const char* reason = ::ERR_reason_error_string(error);
  return reason != nullptr ? reason : "OpenSSL gives no reason";
}

bool is_number(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> ignored{};
  return ::inet_pton(AF_INET, host.c_str(), ignored.data()) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), ignored.data()) == 1;
}

}  // namespace

TlsChannel::TlsChannel(int fd, const Tls& tls, const std::string& host, std::string name,
                       const Limit& limit)
    : name_(std::move(name)), wire_{fd, 0, false} {
  if (tls.fingerprint.empty() && tls.ca_file.empty()) {
    throw Error(
        "TLS without knowing the other end protects nothing: give the certificate's "
        "fingerprint (dtactctl cert --show prints it on the daemon's machine) or a CA file");
  }
  const std::string pinned = tls.fingerprint.empty() ? "" : plain(tls.fingerprint);
  ::ERR_clear_error();
  prepare(tls, host);
  shake_hands(limit);
  if (!pinned.empty()) check_fingerprint(pinned);
}

void TlsChannel::prepare(const Tls& tls, const std::string& host) {
  const auto require = [](bool ok) {
    if (!ok) throw Error("OpenSSL could not be set up: " + last_reason());
  };
  // Any type that exists will do (curl's lib/vtls/openssl.c takes this one too); of new ones a
  // process has 127, and every reconnection would take one.
  method_.reset(::BIO_meth_new(BIO_TYPE_MEM, "dtact socket"));
  require(method_ != nullptr && ::BIO_meth_set_read(method_.get(), &take) == 1 &&
          ::BIO_meth_set_write(method_.get(), &give) == 1 &&
          ::BIO_meth_set_ctrl(method_.get(), &control) == 1);
  context_.reset(::SSL_CTX_new(::TLS_client_method()));
  require(context_ != nullptr &&
          ::SSL_CTX_set_min_proto_version(context_.get(), TLS1_3_VERSION) == 1);
  // Messages carry their length, so a connection may end without TLS's close_notify.
  ::SSL_CTX_set_options(context_.get(), SSL_OP_IGNORE_UNEXPECTED_EOF);
  ::SSL_CTX_set_mode(context_.get(),
                     SSL_MODE_ENABLE_PARTIAL_WRITE | SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER);
  if (!tls.ca_file.empty()) {
    if (::SSL_CTX_load_verify_file(context_.get(), tls.ca_file.c_str()) != 1) {
      throw Error(fmt::format("cannot read certificates from {}: {}; it has to be a PEM file",
                              tls.ca_file.string(), last_reason()));
    }
    ::SSL_CTX_set_verify(context_.get(), SSL_VERIFY_PEER, nullptr);
  }
  ssl_.reset(::SSL_new(context_.get()));
  require(ssl_ != nullptr);
  if (is_number(host)) {
    require(::X509_VERIFY_PARAM_set1_ip_asc(::SSL_get0_param(ssl_.get()), host.c_str()) == 1);
  } else {
    require(::SSL_set1_host(ssl_.get(), host.c_str()) == 1 &&
            ::SSL_set_tlsext_host_name(ssl_.get(), host.c_str()) == 1);
  }
  BIO* bio = ::BIO_new(method_.get());
  require(bio != nullptr);
  ::BIO_set_data(bio, &wire_);
  ::BIO_set_init(bio, 1);
  ::SSL_set_bio(ssl_.get(), bio, bio);  // which owns it now
}

void TlsChannel::shake_hands(const Limit& limit) {
  for (;;) {
    ::ERR_clear_error();
    const int returned = ::SSL_connect(ssl_.get());
    if (returned == 1) return;
    const int why = ::SSL_get_error(ssl_.get(), returned);
    if (why != SSL_ERROR_WANT_READ && why != SSL_ERROR_WANT_WRITE) explain_failed_handshake();
    if (!wait(wire_.fd, why == SSL_ERROR_WANT_READ ? POLLIN : POLLOUT, limit)) {
      throw ConnectionError(fmt::format(
          "{} does not answer a TLS handshake: does this daemon speak TLS there?", name_));
    }
  }
}

void TlsChannel::explain_failed_handshake() const {
  const long verdict = ::SSL_get_verify_result(ssl_.get());
  if (verdict != X509_V_OK) {
    throw IdentityError(fmt::format(
        "the certificate of {} does not hold: {}. Give the CA file that it was signed "
        "with and a name that it contains, or pin its fingerprint. Nothing was sent to it",
        name_, ::X509_verify_cert_error_string(verdict)));
  }
  const std::string reason = wire_.ended        ? "it ended the connection"
                             : wire_.error != 0 ? std::generic_category().message(wire_.error)
                                                : last_reason();
  throw ConnectionError(
      fmt::format("no TLS connection to {}: {}. Leave the fingerprint and the CA file out if this "
                  "daemon does not speak TLS there",
                  name_, reason));
}

void TlsChannel::check_fingerprint(const std::string& expected) const {
  struct FreeCertificate {
    void operator()(X509* p) const { ::X509_free(p); }
  };
  const std::unique_ptr<X509, FreeCertificate> certificate(::SSL_get1_peer_certificate(ssl_.get()));
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  std::string seen;
  if (certificate && ::X509_digest(certificate.get(), ::EVP_sha256(), digest.data(), &size) == 1) {
    for (unsigned int i = 0; i < size; ++i) seen += fmt::format("{:02x}", digest[i]);
  }
  if (seen == expected) return;
  throw IdentityError(
      fmt::format("{} shows a certificate with the fingerprint {}, expected was {}: if the daemon "
                  "got a new certificate (dtactctl cert --show prints its fingerprint), pin "
                  "that one; else another machine answers here. Nothing was sent to it",
                  name_, seen, expected));
}

int TlsChannel::take(BIO* bio, char* into, int size) {
  auto& wire = *static_cast<Wire*>(::BIO_get_data(bio));
  ::BIO_clear_retry_flags(bio);
  const Transfer transfer = PlainChannel(wire.fd).read({into, static_cast<std::size_t>(size)});
  if (transfer.bytes > 0) return static_cast<int>(transfer.bytes);
  if (transfer.wait != 0) {
    ::BIO_set_retry_read(bio);
    return -1;
  }
  wire.error = transfer.error;
  wire.ended = transfer.error == 0;
  return wire.ended ? 0 : -1;
}

int TlsChannel::give(BIO* bio, const char* bytes, int size) {
  auto& wire = *static_cast<Wire*>(::BIO_get_data(bio));
  ::BIO_clear_retry_flags(bio);
  const Transfer transfer = PlainChannel(wire.fd).write({bytes, static_cast<std::size_t>(size)});
  if (transfer.bytes > 0) return static_cast<int>(transfer.bytes);
  if (transfer.wait != 0) ::BIO_set_retry_write(bio);
  wire.error = transfer.error;
  return -1;
}

long TlsChannel::control(BIO* bio, int command, long /*number*/, void* /*pointer*/) {
  if (command == BIO_CTRL_FLUSH) return 1;
  if (command == BIO_CTRL_EOF) return static_cast<const Wire*>(::BIO_get_data(bio))->ended ? 1 : 0;
  return 0;
}

Transfer TlsChannel::result(int returned) {
  if (returned > 0) return {static_cast<std::size_t>(returned), 0, 0};
  switch (::SSL_get_error(ssl_.get(), returned)) {
    case SSL_ERROR_WANT_READ:
      return {0, POLLIN, 0};
    case SSL_ERROR_WANT_WRITE:
      return {0, POLLOUT, 0};
    case SSL_ERROR_ZERO_RETURN:
      return {};
    case SSL_ERROR_SYSCALL:
      return {0, 0, wire_.ended ? 0 : wire_.error};
    default:
      throw ConnectionError(
          fmt::format("the TLS connection to {} broke: {}", name_, last_reason()));
  }
}

Transfer TlsChannel::read(std::span<char> into) {
  ::ERR_clear_error();
  return result(::SSL_read(ssl_.get(), into.data(), static_cast<int>(into.size())));
}

Transfer TlsChannel::write(std::string_view bytes) {
  ::ERR_clear_error();
  return result(::SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size())));
}

}  // namespace dtact::client
