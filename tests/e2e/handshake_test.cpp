// Unauthenticated clients that ask for TLS handshakes: the honest clients beside them are served,
// and nothing is left of the others. Times are printed, since a test machine has delays of its own.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <signal.h>
#include <sys/socket.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "tests/e2e/besieged.hpp"

namespace dtact::e2e {
namespace {

using Clock = std::chrono::steady_clock;

/// A pair of `dtactctl cert`.
struct Certificate {
  Certificate() {
    std::string output;
    EXPECT_EQ(
        run_program({DTACTCTL_PROGRAM, "cert", "-o", folder.path().string(), "--name", "127.0.0.1"},
                    &output),
        0)
        << output;
    EXPECT_EQ(run_program({DTACTCTL_PROGRAM, "cert", "--show", file("dtactd.crt")}, &fingerprint),
              0);
    fingerprint.resize(64);
  }
  [[nodiscard]] std::string file(const char* name) const { return (folder.path() / name).string(); }

  TempFolder folder;
  std::string fingerprint;
};

class Handshakes : public testing::Test {
 protected:
  Handshakes() : context_(::SSL_CTX_new(::TLS_client_method())) {
    ::signal(SIGPIPE, SIG_IGN);  // OpenSSL writes to connections that are closed
    daemon_.begin();
  }

  /// A connection from `from`, on which no call waits for more than some seconds.
  [[nodiscard]] base::UniqueFd knock(const char* from) const {
    base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const timeval timeout{5, 0};
    ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    ::inet_pton(AF_INET, from, &address.sin_addr);
    ::bind(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address);
    address.sin_port = htons(daemon_.port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) fd.reset();
    return fd;
  }
  struct Free {
    void operator()(SSL_CTX* p) const { ::SSL_CTX_free(p); }
    void operator()(SSL* p) const { ::SSL_free(p); }
  };
  [[nodiscard]] std::unique_ptr<SSL, Free> ssl() const {
    return std::unique_ptr<SSL, Free>(::SSL_new(context_.get()));
  }
  /// The first bytes of a client of TLS.
  [[nodiscard]] std::string client_hello() const {
    const auto one = ssl();
    BIO* out = ::BIO_new(::BIO_s_mem());
    ::SSL_set_bio(one.get(), ::BIO_new(::BIO_s_mem()), out);
    (void)::SSL_connect(one.get());
    char* bytes = nullptr;
    const long size = ::BIO_get_mem_data(out, &bytes);
    return {bytes, static_cast<std::size_t>(size)};
  }

  Certificate certificate_;
  Besieged daemon_{{"net.tls_certificate=" + certificate_.file("dtactd.crt"),
                    "net.tls_key=" + certificate_.file("dtactd.key")},
                   client::Tls{certificate_.fingerprint, ""}};
  std::unique_ptr<SSL_CTX, Free> context_;
};

// Before: 7.5 to 9.6 MiB were left.
TEST_F(Handshakes, ThousandsThatAreLeftHalfDone) {
  const std::string hello = client_hello();
  std::vector<base::UniqueFd> peers;
  for (int i = 0; i < 4000; ++i) {
    peers.push_back(knock("127.0.0.2"));
    if (peers.back()) (void)::send(peers.back().get(), hello.data(), hello.size(), MSG_NOSIGNAL);
  }
  peers.clear();
  daemon_.end("4000 TLS handshakes that are left half done");
}

// Before: as many as the daemon had time for, 7,271 in 3.7 s, each of 0.4 ms.
TEST_F(Handshakes, OneAddressGetsAHundredASecond) {
  std::atomic<bool> stop{false};
  std::atomic<int> done{0};
  std::atomic<int> refused{0};
  const auto began = Clock::now();
  std::vector<std::thread> flood;
  for (int i = 0; i < 4; ++i) {
    flood.emplace_back([&] {
      while (!stop) {
        const base::UniqueFd fd = knock("127.0.0.2");
        const auto one = ssl();
        ::SSL_set_fd(one.get(), fd.get());
        (fd && ::SSL_connect(one.get()) == 1 ? done : refused) += 1;
      }
    });
  }
  EXPECT_TRUE(daemon_.honest().receive(180)) << daemon_.honest().broken();
  stop = true;
  for (std::thread& thread : flood) thread.join();
  const std::chrono::duration<double> took = Clock::now() - began;
  EXPECT_GE(done, 50);
  EXPECT_LE(done, 100 * (took.count() + 1) + 1);
  fmt::print("in {:.1f} s {} handshakes were made and {} refused\n", took.count(), done.load(),
             refused.load());
  daemon_.end("a flood of TLS handshakes");
}

}  // namespace
}  // namespace dtact::e2e
