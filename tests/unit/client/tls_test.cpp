// Checks of the server's certificate; the token is sent to the right server only.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <ifaddrs.h>

#include <algorithm>
#include <cctype>
#include <csignal>
#include <optional>

#include "clients/cpp/client.hpp"
#include "tests/unit/client/certificate.hpp"
#include "tests/unit/client/played_daemon.hpp"

namespace dtact::client::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

const Certificate& certificate() {
  static const Certificate made("IP:127.0.0.1");
  return made;
}

class TlsDaemon : public PlayedDaemon {
 public:
  explicit TlsDaemon(std::vector<Play> plays)
      : PlayedDaemon(std::move(plays), listen_on(), certificate().server()) {
    options.tls = Tls{certificate().fingerprint(), ""};
    options.token = "s3cret";
  }
};

/// The message of the exception E that connecting throws.
template <typename E>
std::string refusal(const Options& options) {
  try {
    const Client client(options);
  } catch (const E& e) {
    return e.what();
  }
  return "connected";
}

class CaFile : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (std::filesystem::temp_directory_path() / "dtact_ca_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  [[nodiscard]] std::filesystem::path file() const { return folder_ / "ca.pem"; }

 private:
  std::filesystem::path folder_;
};

TEST(Fingerprint, OfTheDaemonThatWasMeant) {
  std::string with_colons = certificate().fingerprint();
  for (std::size_t i = 2; i < with_colons.size(); i += 3) with_colons.insert(i, ":");
  std::ranges::transform(with_colons, with_colons.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const std::string& text : {certificate().fingerprint(), with_colons}) {
    v1::Hello hello;
    TlsDaemon daemon({[&hello](Peer& peer) {
      hello = peer.greet();
      peer.frame(7);
      (void)peer.ends_silently();
    }});
    daemon.options.tls->fingerprint = text;
    {
      Client client(daemon.options);
      EXPECT_EQ(client.server().program(), "dtactd 9.8.7");
      const auto item = client.next(kLong);
      ASSERT_TRUE(item.has_value());
      EXPECT_EQ(std::get<v1::Frame>(*item).sequence(), 7U);
      EXPECT_FALSE(client.next(std::chrono::milliseconds(1)).has_value());
    }
    daemon.finish();
    EXPECT_EQ(hello.token(), "s3cret");
  }
}

TEST(Fingerprint, OfAnotherIsShownBesideTheExpectedOne) {
  bool silent = false;
  TlsDaemon daemon({[&silent](Peer& peer) { silent = peer.ends_silently(); }});
  const std::string expected(64, 'a');
  daemon.options.tls->fingerprint = expected;
  EXPECT_THAT(refusal<IdentityError>(daemon.options),
              AllOf(HasSubstr(expected), HasSubstr(certificate().fingerprint()),
                    HasSubstr("dtactctl cert")));
  daemon.finish();
  EXPECT_TRUE(silent);
}

TEST(Fingerprint, IsAskedForAgainAfterALoss) {
  const Certificate other("IP:127.0.0.1");
  auto first = std::make_unique<TlsDaemon>(
      std::vector<PlayedDaemon::Play>{[](Peer& peer) { peer.greet(); }});
  Options options = first->options;
  options.reconnect = Reconnect{std::chrono::milliseconds(5), std::chrono::milliseconds(20)};
  Client client(options);
  first.reset();
  const PlayedDaemon second({[](Peer& peer) { (void)peer.ends_silently(); }},
                            listen_on(options.port), other.server());
  EXPECT_THROW((void)client.next(kLong), IdentityError);
}

TEST(Fingerprint, HasToBeOne) {
  for (const std::string& text : {std::string("abc"), std::string(64, 'x'), std::string(66, 'a')}) {
    TlsDaemon daemon({[](Peer&) {}});
    daemon.options.tls->fingerprint = text;
    EXPECT_THAT(refusal<Error>(daemon.options), HasSubstr("is no fingerprint"));
  }
  TlsDaemon daemon({[](Peer&) {}});
  daemon.options.tls = Tls{};
  EXPECT_THAT(refusal<Error>(daemon.options), HasSubstr("protects nothing"));
}

TEST_F(CaFile, VerifiesSignatureAndName) {
  certificate().write_pem(file());
  v1::Hello hello;
  TlsDaemon daemon({[&hello](Peer& peer) { hello = peer.greet(); }});
  daemon.options.tls = Tls{"", file()};
  EXPECT_EQ(refusal<Error>(daemon.options), "connected");
  daemon.finish();
  EXPECT_EQ(hello.token(), "s3cret");
}

TEST_F(CaFile, RefusesAnotherName) {
  certificate().write_pem(file());
  TlsDaemon daemon({[](Peer& peer) { EXPECT_TRUE(peer.ends_silently()); }});
  daemon.options.tls = Tls{"", file()};
  daemon.options.host = "localhost";
  EXPECT_THAT(refusal<IdentityError>(daemon.options),
              HasSubstr("does not hold: hostname mismatch"));
}

TEST_F(CaFile, RefusesAnotherSignature) {
  Certificate("IP:127.0.0.1").write_pem(file());
  TlsDaemon daemon({[](Peer& peer) { EXPECT_TRUE(peer.ends_silently()); }});
  daemon.options.tls = Tls{"", file()};
  EXPECT_THAT(refusal<IdentityError>(daemon.options), HasSubstr("does not hold: "));
  daemon.options.tls->ca_file = "/no/such/file";
  TlsDaemon another({[](Peer&) {}});
  daemon.options.port = another.options.port;
  EXPECT_THAT(refusal<Error>(daemon.options), HasSubstr("/no/such/file"));
}

TEST(TlsChannel, CarriesMuchBothWays) {
  const std::string picture(8U << 20U, 'p');
  std::size_t received = 0;
  TlsDaemon daemon({[&](Peer& peer) {
    peer.greet();
    received = peer.done().upload_calibration().reference_png().size();
    v1::Reply files;
    files.mutable_calibration()->set_reference_png(picture);
    peer.answer(files);
  }});
  Client client(daemon.options);
  v1::UploadCalibration upload;
  upload.set_reference_png(picture);
  (void)client.upload_calibration(upload);
  EXPECT_EQ(client.calibration().reference_png(), picture);
  EXPECT_EQ(received, picture.size());
}

TEST(TlsChannel, EndsWithASentenceAndWithoutASignal) {
  TlsDaemon daemon({[](Peer& peer) {
    peer.greet();
    (void)peer.request();
    const linger now{1, 0};  // a reset
    ::setsockopt(peer.fd(), SOL_SOCKET, SO_LINGER, &now, sizeof now);
  }});
  Client client(daemon.options);
  EXPECT_THROW((void)client.status(), ConnectionError);
  daemon.finish();
  struct sigaction before{};
  struct sigaction deadly{};
  deadly.sa_handler = SIG_DFL;
  ::sigaction(SIGPIPE, &deadly, &before);
  for (int i = 0; i < 3; ++i) EXPECT_THROW((void)client.status(), ConnectionError);
  ::sigaction(SIGPIPE, &before, nullptr);
}

TEST(TlsChannel, IsNotWhatAPlainDaemonSpeaks) {
  PlayedDaemon daemon({[](Peer& peer) {
    peer.send_bytes("\0\0\0\4what");
    (void)peer.ends_silently();
  }});
  daemon.options.tls = Tls{certificate().fingerprint(), ""};
  EXPECT_THAT(refusal<ConnectionError>(daemon.options),
              HasSubstr("no TLS connection to 127.0.0.1"));
}

TEST(TlsChannel, DoesNotWaitForEver) {
  PlayedDaemon daemon({[](Peer& peer) {
    while (!peer.ends_silently()) {
    }
  }});
  daemon.options.tls = Tls{certificate().fingerprint(), ""};
  daemon.options.timeout = std::chrono::milliseconds(100);
  EXPECT_THAT(refusal<ConnectionError>(daemon.options),
              HasSubstr("does not answer a TLS handshake"));
}

TEST(PlainChannel, SaysThatTheOtherEndMaySpeakTls) {
  TlsDaemon daemon({[](Peer&) {}});
  daemon.options.tls.reset();
  EXPECT_THAT(refusal<ConnectionError>(daemon.options), HasSubstr("it speaks TLS there"));
}

/// An address of this machine that is not loopback.
std::optional<in_addr_t> own_address() {
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return std::nullopt;
  std::optional<in_addr_t> found;
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    const auto host = ntohl(reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr.s_addr);
    if (host >> 24U != 127) found = host;
  }
  ::freeifaddrs(all);
  return found;
}

TEST(PlainChannel, TakesATokenToOtherMachinesOnlyWhereAllowed) {
  const auto host = own_address();
  if (!host.has_value()) GTEST_SKIP() << "this machine has no address but loopback";
  bool silent = false;
  std::string token;
  PlayedDaemon daemon({[&silent](Peer& peer) { silent = peer.ends_silently(); },
                       [&token](Peer& peer) { token = peer.greet().token(); }},
                      listen_on(0, *host));
  const in_addr address{htonl(*host)};
  daemon.options.host = ::inet_ntoa(address);
  daemon.options.token = "s3cret";
  EXPECT_THAT(
      refusal<IdentityError>(daemon.options),
      AllOf(HasSubstr("the token was not sent"), HasSubstr("fingerprint"), HasSubstr("insecure")));
  daemon.options.insecure = true;
  EXPECT_EQ(refusal<Error>(daemon.options), "connected");
  daemon.finish();
  EXPECT_TRUE(silent);
  EXPECT_EQ(token, "s3cret");
}

}  // namespace
}  // namespace dtact::client::test
