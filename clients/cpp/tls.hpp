#pragma once

#include <openssl/ssl.h>

#include <memory>
#include <string>

#include "clients/cpp/channel.hpp"
#include "clients/cpp/options.hpp"

namespace dtact::client {

/// TLS 1.3 over a connected socket. Not part of the library's interface.
///
/// OpenSSL itself and not Asio's stream: that one has no deadlines of its own, and on a socket that
/// does not block its writes lose what was encrypted and not sent. The socket is reached through a
/// BIO of our own, since OpenSSL's raises SIGPIPE.
class TlsChannel : public Channel {
 public:
  /// Shakes hands and verifies the other end; nothing but the handshake is sent before. `name` is
  /// for sentences, `host` what a certificate of `ca_file` has to name. Throws ConnectionError, and
  /// IdentityError for another peer than the one that `tls` asks for.
  TlsChannel(int fd, const Tls& tls, const std::string& host, std::string name, const Limit& limit);
  [[nodiscard]] Transfer read(std::span<char> into) override;
  [[nodiscard]] Transfer write(std::string_view bytes) override;

 private:
  struct Free {
    void operator()(SSL_CTX* p) const { ::SSL_CTX_free(p); }
    void operator()(SSL* p) const { ::SSL_free(p); }
    void operator()(BIO_METHOD* p) const { ::BIO_meth_free(p); }
  };
  /// The socket as OpenSSL sees it.
  struct Wire {
    int fd = -1;
    int error = 0;       ///< errno of the last read or write that failed.
    bool ended = false;  ///< The other end has closed.
  };

  [[nodiscard]] static int take(BIO* bio, char* into, int size);
  [[nodiscard]] static int give(BIO* bio, const char* bytes, int size);
  [[nodiscard]] static long control(BIO* bio, int command, long number, void* pointer);

  void prepare(const Tls& tls, const std::string& host);
  void shake_hands(const Limit& limit);
  [[noreturn]] void explain_failed_handshake() const;
  void check_fingerprint(const std::string& expected) const;
  [[nodiscard]] Transfer result(int returned);

  std::string name_;
  Wire wire_;
  std::unique_ptr<BIO_METHOD, Free> method_;
  std::unique_ptr<SSL_CTX, Free> context_;
  std::unique_ptr<SSL, Free> ssl_;
};

}  // namespace dtact::client
