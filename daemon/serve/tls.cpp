#include "daemon/serve/tls.hpp"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <openssl/x509err.h>

#include <boost/asio/buffer.hpp>
#include <ctime>
#include <memory>
#include <stdexcept>

#include "daemon/serve/private_file.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"

namespace dtact::net {
namespace {

namespace asio = boost::asio;
namespace ssl = asio::ssl;
using boost::system::error_code;

constexpr const char* kCertificateHint = "dtactctl cert makes a pair";
/// From how many days before it expires a certificate is warned of.
constexpr int kWarningDays = 30;

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& why) {
  throw std::runtime_error(fmt::format("{}: {}", file.string(), why));
}

std::string read_certificate(const std::filesystem::path& file) {
  try {
    return base::read_file(file, 1U << 20U);
  } catch (const std::exception& e) {
    throw std::runtime_error(
        fmt::format("the TLS certificate: {}; {}", e.what(), kCertificateHint));
  }
}

void use_certificate(ssl::context& context, const std::filesystem::path& file) {
  error_code error;
  context.use_certificate_chain(asio::buffer(read_certificate(file)), error);
  if (error) {
    fail(file, fmt::format("is no PEM certificate ({}); {}", error.message(), kCertificateHint));
  }
}

bool is_mismatch(const error_code& error) {
  const auto code = static_cast<unsigned long>(error.value());
  return ERR_GET_LIB(code) == ERR_LIB_X509 && ERR_GET_REASON(code) == X509_R_KEY_VALUES_MISMATCH;
}

void use_key(ssl::context& context, const std::filesystem::path& file,
             const std::filesystem::path& certificate) {
  const std::string text = read_private_file(file, "the TLS key");
  const auto asked = std::make_shared<bool>(false);
  // Without it OpenSSL prompts on the terminal.
  context.set_password_callback([asked](std::size_t, ssl::context::password_purpose) {
    *asked = true;
    return std::string();
  });
  error_code error;
  context.use_private_key(asio::buffer(text), ssl::context::pem, error);
  if (*asked) {
    fail(file, fmt::format("wants a pass phrase, which nobody could type at start: openssl pkey "
                           "-in {} takes it away",
                           file.string()));
  }
  // A key of the certificate's kind is compared as it is taken, one of another kind only when
  // asked.
  if (is_mismatch(error) || (!error && ::SSL_CTX_check_private_key(context.native_handle()) != 1)) {
    fail(file, fmt::format("does not belong to the certificate {}: name the two files of one "
                           "pair; {}",
                           certificate.string(), kCertificateHint));
  }
  if (error) fail(file, fmt::format("is no PEM key ({}); {}", error.message(), kCertificateHint));
}

std::chrono::sys_seconds expiry_of(const X509& certificate, const std::filesystem::path& file) {
  std::tm time{};
  if (::ASN1_TIME_to_tm(::X509_get0_notAfter(&certificate), &time) != 1) {
    fail(file, fmt::format("does not say until when it is good; {}", kCertificateHint));
  }
  return std::chrono::sys_seconds(std::chrono::seconds(::timegm(&time)));
}

}  // namespace

Tls::Tls(const std::filesystem::path& certificate, const std::filesystem::path& key)
    : context(ssl::context::tls_server) {
  SSL_CTX* native = context.native_handle();
  ::SSL_CTX_set_min_proto_version(native, TLS1_2_VERSION);
  ::SSL_CTX_set_options(native, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_TICKET | SSL_OP_NO_COMPRESSION);
  ::SSL_CTX_set_session_cache_mode(native, SSL_SESS_CACHE_OFF);
  use_certificate(context, certificate);
  use_key(context, key, certificate);
  const X509* leaf = ::SSL_CTX_get0_certificate(native);
  expires = expiry_of(*leaf, certificate);
  fingerprint = wire::fingerprint(*leaf);
}

std::unique_ptr<Tls> make_tls(const NetConfig& config) {
  if (config.tls_certificate.empty()) return nullptr;
  return std::make_unique<Tls>(config.tls_certificate, config.tls_key);
}

int days_until(std::chrono::sys_seconds then, std::chrono::sys_seconds now) {
  return static_cast<int>(std::chrono::floor<std::chrono::days>(then - now).count());
}

CertificateWatch::CertificateWatch(asio::io_context& io, const NetConfig& config,
                                   const std::unique_ptr<Tls>& tls)
    : config_(config), tls_(tls), timer_(io) {}

void CertificateWatch::check() {
  if (tls_ == nullptr || stopped_) return;
  using std::chrono::system_clock;
  const int days =
      days_until(tls_->expires, std::chrono::floor<std::chrono::seconds>(system_clock::now()));
  if (days < kWarningDays) {
    const std::string when =
        days < 0 ? "has expired, or this machine's clock is wrong (date): clients that pin its "
                   "fingerprint still connect, others do not"
                 : fmt::format("expires in {} days", days);
    config_.log(
        {LogLevel::warning, fmt::format("the TLS certificate {} {}; {}",
                                        config_.tls_certificate.string(), when, kCertificateHint)});
  }
  timer_.expires_after(std::chrono::days(1));
  timer_.async_wait([this](const error_code& error) {
    if (!error) check();
  });
}

void CertificateWatch::stop() {
  // The timer may have expired already: then its handler still comes, without an error.
  stopped_ = true;
  timer_.cancel();
}

}  // namespace dtact::net
