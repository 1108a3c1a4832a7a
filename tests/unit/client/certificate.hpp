#pragma once

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

namespace dtact::client::test {

/// A self-signed certificate with its key, valid for an hour: the daemon's.
class Certificate {
 public:
  /// `names` has the form of subjectAltName: "IP:127.0.0.1,DNS:gripper".
  explicit Certificate(const std::string& names)
      : key_(::EVP_EC_gen("P-256")),
        certificate_(::X509_new()),
        server_(::SSL_CTX_new(::TLS_server_method())) {
    X509* x = certificate_.get();
    ::X509_set_version(x, 2);
    ::ASN1_INTEGER_set(::X509_get_serialNumber(x), 1);
    ::X509_gmtime_adj(::X509_getm_notBefore(x), -3600);
    ::X509_gmtime_adj(::X509_getm_notAfter(x), 3600);
    ::X509_set_pubkey(x, key_.get());
    X509_NAME* name = ::X509_get_subject_name(x);
    ::X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC,
                                 reinterpret_cast<const unsigned char*>("dtactd"), -1, -1, 0);
    ::X509_set_issuer_name(x, name);
    X509_EXTENSION* alternative =
        ::X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, names.c_str());
    ::X509_add_ext(x, alternative, -1);
    ::X509_EXTENSION_free(alternative);
    if (::X509_sign(x, key_.get(), ::EVP_sha256()) == 0 ||
        ::SSL_CTX_use_certificate(server_.get(), x) != 1 ||
        ::SSL_CTX_use_PrivateKey(server_.get(), key_.get()) != 1) {
      throw std::runtime_error("no certificate");
    }
  }

  /// SHA-256 of the DER encoding, lower case.
  [[nodiscard]] std::string fingerprint() const {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned int size = 0;
    ::X509_digest(certificate_.get(), ::EVP_sha256(), digest.data(), &size);
    std::string text;
    for (unsigned int i = 0; i < size; ++i) {
      std::array<char, 3> digits{};
      std::snprintf(digits.data(), digits.size(), "%02x", digest[i]);
      text += digits.data();
    }
    return text;
  }
  void write_pem(const std::filesystem::path& file) const {
    FILE* stream = std::fopen(file.c_str(), "w");
    if (stream == nullptr) throw std::runtime_error("cannot write " + file.string());
    ::PEM_write_X509(stream, certificate_.get());
    std::fclose(stream);
  }
  [[nodiscard]] SSL_CTX* server() const { return server_.get(); }

 private:
  struct Free {
    void operator()(EVP_PKEY* p) const { ::EVP_PKEY_free(p); }
    void operator()(X509* p) const { ::X509_free(p); }
    void operator()(SSL_CTX* p) const { ::SSL_CTX_free(p); }
  };
  std::unique_ptr<EVP_PKEY, Free> key_;
  std::unique_ptr<X509, Free> certificate_;
  std::unique_ptr<SSL_CTX, Free> server_;
};

}  // namespace dtact::client::test
