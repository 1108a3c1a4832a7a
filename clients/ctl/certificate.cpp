#include "clients/ctl/certificate.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <memory>
#include <stdexcept>

#include "proto/fingerprint.hpp"

namespace dtact::ctl {
namespace {

constexpr long kDay_s = 24L * 3600;
constexpr long kLife_s = 3652 * kDay_s;

/// Longest host name, bytes (RFC 1035).
constexpr std::size_t kLongestName = 253;
/// Longest common name of a subject, bytes (RFC 5280, ub-common-name).
constexpr std::size_t kLongestSubject = 64;

struct Free {
  void operator()(EVP_PKEY* p) const { ::EVP_PKEY_free(p); }
  void operator()(X509* p) const { ::X509_free(p); }
  void operator()(X509_EXTENSION* p) const { ::X509_EXTENSION_free(p); }
  void operator()(BIO* p) const { ::BIO_free(p); }
};
template <typename Object>
using Owned = std::unique_ptr<Object, Free>;

void require(bool done, const char* what) {
  if (!done) throw std::runtime_error(fmt::format("OpenSSL cannot {}", what));
}

bool is_address(const std::string& name) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return ::inet_pton(AF_INET, name.c_str(), bytes.data()) == 1 ||
         ::inet_pton(AF_INET6, name.c_str(), bytes.data()) == 1;
}

/// An entry of subjectAltName. It must contain nothing else, because OpenSSL splits lists.
std::string entry_of(const std::string& name) {
  if (is_address(name)) return "IP:" + name;
  const bool fits = !name.empty() && name.size() <= kLongestName &&
                    std::all_of(name.begin(), name.end(), [](unsigned char c) {
                      return std::isalnum(c) != 0 || c == '-' || c == '.' || c == '_';
                    });
  if (!fits) {
    throw std::runtime_error(
        fmt::format("\"{}\" is neither a host name nor an IPv4 or IPv6 address", name));
  }
  return "DNS:" + name;
}

void extend(X509& certificate, int kind, const std::string& value) {
  X509V3_CTX context{};
  ::X509V3_set_ctx(&context, &certificate, &certificate, nullptr, nullptr, 0);
  const Owned<X509_EXTENSION> extension(
      ::X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  require(extension != nullptr && ::X509_add_ext(&certificate, extension.get(), -1) == 1,
          "extend the certificate");
}

Owned<X509> make_certificate(EVP_PKEY& key, const std::vector<std::string>& names) {
  std::string alternatives;
  for (const std::string& name : names) {
    alternatives += (alternatives.empty() ? "" : ",") + entry_of(name);
  }
  Owned<X509> certificate(::X509_new());
  require(certificate != nullptr, "make a certificate");
  std::uint64_t serial = 0;
  require(::RAND_bytes(reinterpret_cast<unsigned char*>(&serial), sizeof serial) == 1,
          "make a serial number");
  require(
      ::X509_set_version(certificate.get(), X509_VERSION_3) == 1 &&
          ::ASN1_INTEGER_set_uint64(::X509_get_serialNumber(certificate.get()), serial | 1U) == 1 &&
          // A day for clocks that are behind.
          ::X509_gmtime_adj(::X509_getm_notBefore(certificate.get()), -kDay_s) != nullptr &&
          ::X509_gmtime_adj(::X509_getm_notAfter(certificate.get()), kLife_s) != nullptr &&
          ::X509_set_pubkey(certificate.get(), &key) == 1,
      "fill the certificate");
  X509_NAME* subject = ::X509_get_subject_name(certificate.get());
  const std::string name = names.front().substr(0, kLongestSubject);
  require(::X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_UTF8,
                                       reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1,
                                       0) == 1 &&
              ::X509_set_issuer_name(certificate.get(), subject) == 1,
          "name the certificate");
  extend(*certificate, NID_subject_alt_name, alternatives);
  extend(*certificate, NID_basic_constraints, "critical,CA:FALSE");
  extend(*certificate, NID_key_usage, "critical,digitalSignature");
  extend(*certificate, NID_ext_key_usage, "serverAuth");
  extend(*certificate, NID_subject_key_identifier, "hash");
  require(::X509_sign(certificate.get(), &key, ::EVP_sha256()) > 0, "sign the certificate");
  return certificate;
}

template <typename Write>
std::string pem(Write write) {
  const Owned<BIO> memory(::BIO_new(::BIO_s_mem()));
  require(memory != nullptr && write(memory.get()) == 1, "write PEM");
  char* text = nullptr;
  const long size = ::BIO_get_mem_data(memory.get(), &text);
  return {text, static_cast<std::size_t>(size)};
}

/// The address as text; empty for other families and for link-local addresses.
std::string text_of(const sockaddr* address) {
  if (address == nullptr) return {};
  std::array<char, INET6_ADDRSTRLEN> text{};
  const void* bytes = nullptr;
  if (address->sa_family == AF_INET) {
    bytes = &reinterpret_cast<const sockaddr_in*>(address)->sin_addr;
  } else if (address->sa_family == AF_INET6) {
    const auto* v6 = reinterpret_cast<const sockaddr_in6*>(address);
    if (IN6_IS_ADDR_LINKLOCAL(&v6->sin6_addr)) return {};
    bytes = &v6->sin6_addr;
  } else {
    return {};
  }
  const char* written = ::inet_ntop(address->sa_family, bytes, text.data(), text.size());
  return written == nullptr ? std::string() : std::string(written);
}

}  // namespace

Pair make_pair(const std::vector<std::string>& names) {
  const Owned<EVP_PKEY> key(::EVP_EC_gen("P-256"));
  require(key != nullptr, "make a key");
  const auto certificate = make_certificate(*key, names);
  return {pem([&](BIO* out) { return ::PEM_write_bio_X509(out, certificate.get()); }),
          pem([&](BIO* out) {
            return ::PEM_write_bio_PrivateKey(out, key.get(), nullptr, nullptr, 0, nullptr,
                                              nullptr);
          })};
}

std::vector<std::string> own_names() {
  std::array<char, 256> host{};
  if (::gethostname(host.data(), host.size() - 1) != 0) host[0] = 0;
  std::vector<std::string> names;
  const auto add = [&names](const std::string& name) {
    if (!name.empty() && std::ranges::find(names, name) == names.end()) names.push_back(name);
  };
  const std::string name(host.data());
  add(name);
  if (!name.empty()) add(name.substr(0, name.find('.')) + ".local");
  add("localhost");
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) == 0) {
    for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
      add(text_of(one->ifa_addr));
    }
    ::freeifaddrs(first);
  }
  return names;
}

std::string fingerprint_of(std::string_view text) {
  const Owned<BIO> memory(::BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  const Owned<X509> certificate(::PEM_read_bio_X509(memory.get(), nullptr, nullptr, nullptr));
  if (certificate == nullptr) throw std::runtime_error("is no PEM certificate");
  return wire::fingerprint(*certificate);
}

}  // namespace dtact::ctl
