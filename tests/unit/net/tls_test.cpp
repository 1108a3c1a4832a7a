#include "daemon/serve/tls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "clients/ctl/certificate.hpp"
#include "hal/base/atomic_file.hpp"
#include "proto/fingerprint.hpp"
#include "tests/unit/calibration/sample.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::net::test {
namespace {

namespace fs = std::filesystem;
using calibration::TempFolder;
using testing::AllOf;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;

/// A client that accepts any certificate.
class TlsClient {
 public:
  explicit TlsClient(std::uint16_t port, int version = TLS1_3_VERSION)
      : context_(::SSL_CTX_new(::TLS_client_method())), fd_(connected(port)) {
    ::SSL_CTX_set_max_proto_version(context_.get(), version);
    ssl_.reset(::SSL_new(context_.get()));
    ::SSL_set_fd(ssl_.get(), fd_.get());
    if (::SSL_connect(ssl_.get()) != 1) throw std::runtime_error("no TLS");
  }
  void send(const v1::ClientMessage& message) {
    const auto length = wire::encode_length(message.ByteSizeLong());
    std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
    message.AppendToString(&bytes);
    ASSERT_EQ(::SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size())),
              static_cast<int>(bytes.size()));
  }
  /// Nothing after an end that TLS reports.
  std::optional<v1::ServerMessage> receive() {
    while (decoder_.feed(unread_) != wire::MessageDecoder::Result::message) {
      const int n = ::SSL_read(ssl_.get(), buffer_, sizeof buffer_);
      if (n <= 0) {
        EXPECT_EQ(::SSL_get_error(ssl_.get(), n), SSL_ERROR_ZERO_RETURN);
        return std::nullopt;
      }
      unread_ = {buffer_, static_cast<std::size_t>(n)};
    }
    v1::ServerMessage message;
    if (!message.ParseFromString(decoder_.message())) throw std::runtime_error("no message");
    return message;
  }
  v1::Reply request(v1::ClientMessage message) {
    message.set_id(next_id_++);
    send(message);
    for (;;) {
      const auto answer = receive();
      if (!answer.has_value()) throw std::runtime_error("ended");
      if (answer->has_reply()) return answer->reply();
    }
  }
  v1::Reply hello() {
    v1::ClientMessage message;
    message.mutable_hello()->set_major(1);
    return request(message);
  }
  [[nodiscard]] std::string version() const { return ::SSL_get_version(ssl_.get()); }
  [[nodiscard]] std::string fingerprint() const {
    return wire::fingerprint(*::SSL_get0_peer_certificate(ssl_.get()));
  }

 private:
  struct Free {
    void operator()(SSL_CTX* p) const { ::SSL_CTX_free(p); }
    void operator()(SSL* p) const { ::SSL_free(p); }
  };
  static base::UniqueFd connected(std::uint16_t port) {
    base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error("cannot connect");
    }
    return fd;
  }

  std::unique_ptr<SSL_CTX, Free> context_;
  base::UniqueFd fd_;
  std::unique_ptr<SSL, Free> ssl_;
  std::uint64_t next_id_ = 1;
  wire::MessageDecoder decoder_;
  char buffer_[65536];
  std::string_view unread_;
};

class TlsServer : public ::testing::Test {
 protected:
  TlsServer() {
    config_.tls_certificate = folder_.path() / "dtactd.crt";
    config_.tls_key = folder_.path() / "dtactd.key";
    write(ctl::make_pair({"gripper"}));
  }
  void write(const ctl::Pair& pair) {
    base::write_file_atomically(config_.tls_certificate, pair.certificate);
    base::write_file_atomically(config_.tls_key, pair.key, 0600);
  }
  /// The refusal of the pair; empty when it is accepted.
  std::string refusal() {
    try {
      const Tls tls(config_.tls_certificate, config_.tls_key);
      return {};
    } catch (const std::runtime_error& e) {
      return e.what();
    }
  }

  TempFolder folder_;
  NetConfig config_;
};

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send for constants
TEST_F(TlsServer, CarriesRequestsAndFrames) {
  Rig rig(config_);
  TlsClient client(rig.tcp_port());
  EXPECT_EQ(client.version(), "TLSv1.3");
  EXPECT_TRUE(client.hello().has_hello());
  v1::ClientMessage subscribe;
  subscribe.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  EXPECT_TRUE(client.request(subscribe).has_done());
  for (std::uint64_t sequence = 1; sequence <= 3; ++sequence) {
    rig.port.publish(make_frame(sequence, 800, 600));
    const auto message = client.receive();
    ASSERT_TRUE(message.has_value() && message->has_frame());
    EXPECT_EQ(message->frame().sequence(), sequence);
    EXPECT_EQ(message->frame().depth().data().size(), 2U * 800 * 600);
  }
  v1::ClientMessage get;
  get.mutable_get_status();
  const auto status = client.request(get).status();
  ASSERT_EQ(status.endpoints_size(), 1);
  EXPECT_TRUE(status.endpoints(0).tls());
  EXPECT_EQ(status.endpoints(0).fingerprint(), client.fingerprint());
  EXPECT_EQ(status.endpoints(0).fingerprint(),
            ctl::fingerprint_of(base::read_file(config_.tls_certificate)));
}

TEST_F(TlsServer, SpeaksOneDotTwoAndNothingBefore) {
  const Rig rig(config_);
  TlsClient client(rig.tcp_port(), TLS1_2_VERSION);
  EXPECT_EQ(client.version(), "TLSv1.2");
  EXPECT_TRUE(client.hello().has_hello());
  EXPECT_THROW(TlsClient(rig.tcp_port(), TLS1_1_VERSION), std::runtime_error);
}

TEST_F(TlsServer, EndsAConnectionTheWayTlsDoes) {
  const Rig rig(config_);
  TlsClient client(rig.tcp_port());
  v1::ClientMessage status;
  status.mutable_get_status();
  EXPECT_EQ(client.request(status).error().code(), v1::ERROR_VERSION);
  EXPECT_FALSE(client.receive().has_value());
}

TEST_F(TlsServer, AnswersNobodyInPlainText) {
  Rig rig(config_);
  RawClient plain(rig.tcp_port());
  v1::ClientMessage hello;
  hello.set_id(1);
  hello.mutable_hello()->set_major(1);
  plain.send(hello);
  EXPECT_TRUE(rig.wait_log("no TLS: "));
  TlsClient client(rig.tcp_port());
  EXPECT_TRUE(client.hello().has_hello());
}

TEST_F(TlsServer, LetsGoOfWhoeverDoesNotShakeHands) {
  config_.hello_timeout = std::chrono::milliseconds(50);
  const Rig rig(config_);
  RawClient silent(rig.tcp_port());
  EXPECT_TRUE(silent.ends());
}

TEST_F(TlsServer, SurvivesAClientThatDies) {
  Rig rig(config_);
  {
    TlsClient victim(rig.tcp_port());
    EXPECT_TRUE(victim.hello().has_hello());
    v1::ClientMessage subscribe;
    subscribe.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
    EXPECT_TRUE(victim.request(subscribe).has_done());
    rig.port.publish(make_frame(1, 800, 600));
  }
  EXPECT_TRUE(rig.wait_log("disconnected"));
  TlsClient next(rig.tcp_port());
  EXPECT_TRUE(next.hello().has_hello());
}
// NOLINTEND(misc-const-correctness)

TEST_F(TlsServer, WantsAKeyThatNobodyElseReads) {
  EXPECT_EQ(refusal(), "");
  fs::permissions(config_.tls_key, fs::perms::others_read, fs::perm_options::add);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("the TLS key " + config_.tls_key.string()),
                               HasSubstr("chmod 600 " + config_.tls_key.string())));
}

TEST_F(TlsServer, WantsTheTwoFilesOfOnePair) {
  base::write_file_atomically(config_.tls_key, ctl::make_pair({"other"}).key, 0600);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(config_.tls_key.string() + ": does not belong to"),
                               HasSubstr(config_.tls_certificate.string())));
}

TEST_F(TlsServer, WantsTheTwoFilesOfOnePairOfAnotherKind) {
  EVP_PKEY* rsa = ::EVP_RSA_gen(2048);
  BIO* memory = ::BIO_new(::BIO_s_mem());
  ::PEM_write_bio_PrivateKey(memory, rsa, nullptr, nullptr, 0, nullptr, nullptr);
  char* text = nullptr;
  const long size = ::BIO_get_mem_data(memory, &text);
  base::write_file_atomically(config_.tls_key, {text, static_cast<std::size_t>(size)}, 0600);
  ::BIO_free(memory);
  ::EVP_PKEY_free(rsa);
  EXPECT_THAT(refusal(), HasSubstr("does not belong to"));
}

TEST_F(TlsServer, NeverAsksForAPassPhrase) {
  const std::string plain = base::read_file(config_.tls_key);
  BIO* in = ::BIO_new_mem_buf(plain.data(), static_cast<int>(plain.size()));
  EVP_PKEY* key = ::PEM_read_bio_PrivateKey(in, nullptr, nullptr, nullptr);
  BIO* out = ::BIO_new(::BIO_s_mem());
  unsigned char phrase[] = "secret";
  ::PEM_write_bio_PrivateKey(out, key, ::EVP_aes_256_cbc(), phrase, 6, nullptr, nullptr);
  char* text = nullptr;
  const long size = ::BIO_get_mem_data(out, &text);
  base::write_file_atomically(config_.tls_key, {text, static_cast<std::size_t>(size)}, 0600);
  ::EVP_PKEY_free(key);
  ::BIO_free(in);
  ::BIO_free(out);
  EXPECT_THAT(refusal(), AllOf(HasSubstr("wants a pass phrase"), HasSubstr("openssl pkey -in")));
}

TEST_F(TlsServer, NamesTheFileThatIsNoneOrWrong) {
  base::write_file_atomically(config_.tls_key, "-----BEGIN NONSENSE-----\n", 0600);
  EXPECT_THAT(refusal(), HasSubstr(config_.tls_key.string() + ": is no PEM key"));
  base::write_file_atomically(config_.tls_certificate, "nothing");
  EXPECT_THAT(refusal(), HasSubstr(config_.tls_certificate.string() + ": is no PEM certificate"));
  fs::remove(config_.tls_certificate);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(config_.tls_certificate.string()),
                               HasSubstr("dtactctl cert makes a pair")));
}

/// `pair` with another last day, `days` from now and a minute, signed again.
std::string expiring(const ctl::Pair& pair, int days) {
  BIO* key_text = ::BIO_new_mem_buf(pair.key.data(), static_cast<int>(pair.key.size()));
  EVP_PKEY* key = ::PEM_read_bio_PrivateKey(key_text, nullptr, nullptr, nullptr);
  BIO* text = ::BIO_new_mem_buf(pair.certificate.data(), static_cast<int>(pair.certificate.size()));
  X509* certificate = ::PEM_read_bio_X509(text, nullptr, nullptr, nullptr);
  ::X509_gmtime_adj(::X509_getm_notAfter(certificate), 86400L * days + 60);
  ::X509_sign(certificate, key, ::EVP_sha256());
  BIO* out = ::BIO_new(::BIO_s_mem());
  ::PEM_write_bio_X509(out, certificate);
  char* bytes = nullptr;
  const long size = ::BIO_get_mem_data(out, &bytes);
  std::string made(bytes, static_cast<std::size_t>(size));
  for (BIO* bio : {key_text, text, out}) ::BIO_free(bio);
  ::X509_free(certificate);
  ::EVP_PKEY_free(key);
  return made;
}

/// What status says of the certificate.
int days_reported(const Rig& rig) {
  TlsClient client(rig.tcp_port());
  EXPECT_TRUE(client.hello().has_hello());
  v1::ClientMessage get;
  get.mutable_get_status();
  const auto status = client.request(get).status();
  EXPECT_TRUE(status.endpoints(0).has_certificate_days());
  return status.endpoints(0).certificate_days();
}

// Clients that pin it do not look at its dates.
TEST_F(TlsServer, ServesACertificateThatHasExpiredWithAWarning) {
  ctl::Pair pair = ctl::make_pair({"gripper"});
  pair.certificate = expiring(pair, -2);
  write(pair);
  EXPECT_EQ(refusal(), "");
  Rig rig(config_);
  EXPECT_EQ(days_reported(rig), -2);
  EXPECT_TRUE(rig.wait_log("the TLS certificate " + config_.tls_certificate.string() +
                           " has expired, or this machine's clock is wrong"));
}

TEST_F(TlsServer, WarnsOfACertificateThirtyDaysBeforeItExpires) {
  ctl::Pair pair = ctl::make_pair({"gripper"});
  pair.certificate = expiring(pair, 31);
  write(pair);
  Rig rig(config_);
  EXPECT_EQ(days_reported(rig), 31);
  EXPECT_THAT(rig.log(), Not(HasSubstr("expires in")));
  pair.certificate = expiring(pair, 30);
  write(pair);
  rig.reload(config_);
  EXPECT_EQ(days_reported(rig), 30);
  EXPECT_THAT(rig.log(), Not(HasSubstr("expires in")));
  pair.certificate = expiring(pair, 29);
  write(pair);
  rig.reload(config_);
  EXPECT_EQ(days_reported(rig), 29);
  EXPECT_TRUE(rig.wait_log("expires in 29 days; dtactctl cert makes a pair"));
}

TEST(DaysUntil, RoundsDown) {
  using std::chrono::seconds;
  const std::chrono::sys_seconds now(seconds(1'000'000));
  EXPECT_EQ(days_until(now + seconds(86'399), now), 0);
  EXPECT_EQ(days_until(now + seconds(86'400), now), 1);
  EXPECT_EQ(days_until(now - seconds(1), now), -1);
}

TEST_F(TlsServer, AReloadGivesASocketFileNoFingerprint) {
  config_.address = "";
  config_.unix_socket = folder_.path() / "dtactd.sock";
  boost::asio::io_context io;
  FakePort port;
  FakeStore store;
  Server server(io, config_, port, store);
  server.reload(config_);
  const v1::Status status = server.overview().status;
  ASSERT_EQ(status.endpoints_size(), 1);
  EXPECT_FALSE(status.endpoints(0).tls());
  EXPECT_EQ(status.endpoints(0).fingerprint(), "");
}

TEST(Fingerprint, IsTheDigestOfTheCertificate) {
  const ctl::Pair pair = ctl::make_pair({"gripper"});
  EXPECT_THAT(ctl::fingerprint_of(pair.certificate), MatchesRegex("[0-9a-f]{64}"));
  EXPECT_THROW((void)ctl::fingerprint_of(pair.key), std::runtime_error);
}

}  // namespace
}  // namespace dtact::net::test
