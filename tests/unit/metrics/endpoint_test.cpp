#include "daemon/metrics/endpoint.hpp"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <stdexcept>
#include <thread>
#include <vector>

#include "hal/base/unique_fd.hpp"

namespace dtact::metrics {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

/// An endpoint on a thread of its own that counts how often it was asked.
class Served {
 public:
  Served() : endpoint_(io_, {}, [this] { return "asked " + std::to_string(++asked) + "\n"; }) {
    thread_ = std::thread([this] { io_.run(); });
  }
  /// The event loop must run out of work by itself.
  ~Served() {
    boost::asio::post(io_, [this] { endpoint_.stop(); });
    thread_.join();
  }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;

  [[nodiscard]] base::UniqueFd connect() const {
    base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(endpoint_.port());
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    return fd;
  }
  [[nodiscard]] std::string ask(const std::string& request) const {
    const base::UniqueFd fd = connect();
    EXPECT_EQ(::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(request.size()));
    return rest(fd);
  }
  static std::string rest(const base::UniqueFd& fd) {
    const timeval timeout{60, 0};
    ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
    std::string answer;
    char buffer[4096];
    for (ssize_t n = 0; (n = ::recv(fd.get(), buffer, sizeof buffer, 0)) > 0;) {
      answer.append(buffer, static_cast<std::size_t>(n));
    }
    return answer;
  }

  int asked = 0;

 private:
  boost::asio::io_context io_;
  Endpoint endpoint_;
  std::thread thread_;
};

TEST(MetricsEndpoint, MakesTheTextOnRequest) {
  const Served served;
  EXPECT_EQ(served.asked, 0);
  EXPECT_THAT(served.ask("GET /metrics HTTP/1.1\r\nHost: localhost:9100\r\n\r\n"),
              AllOf(StartsWith("HTTP/1.1 200 OK\r\n"), HasSubstr("text/plain; version=0.0.4"),
                    HasSubstr("Connection: close\r\n"), EndsWith("\r\n\r\nasked 1\n")));
  EXPECT_THAT(served.ask("GET /metrics?name[]=x HTTP/1.0\r\n\r\n"), EndsWith("asked 2\n"));
}

TEST(MetricsEndpoint, SaysWhereTheMetricsAre) {
  const Served served;
  EXPECT_THAT(served.ask("GET / HTTP/1.1\r\nHost: localhost:9100\r\n\r\n"),
              AllOf(StartsWith("HTTP/1.1 404 "), EndsWith("the metrics are at /metrics\n")));
  EXPECT_THAT(served.ask("DELETE /metrics HTTP/1.1\r\nHost: localhost:9100\r\n\r\n"),
              AllOf(StartsWith("HTTP/1.1 405 "), HasSubstr("Allow: GET\r\n")));
  EXPECT_EQ(served.asked, 0);
}

// A page elsewhere whose name leads here.
TEST(MetricsEndpoint, AnswersNoForeignName) {
  const Served served;
  const auto ask = [&](const std::string& host) {
    return served.ask("GET /metrics HTTP/1.1\r\nHost: " + host + "\r\n\r\n");
  };
  for (const char* host : {"evil.example:9100", "localhost.evil.example", "127.0.0.1.evil.example",
                           "[]", ":9100", "[evil]:9100"}) {
    EXPECT_THAT(ask(host), StartsWith("HTTP/1.1 421 ")) << host;
  }
  EXPECT_EQ(served.asked, 0);
  for (const char* host : {"localhost", "127.0.0.1:9100", "[::1]:9100", "192.0.2.7"}) {
    EXPECT_THAT(ask(host), StartsWith("HTTP/1.1 200 ")) << host;
  }
}

TEST(MetricsEndpoint, EndsWhatIsNoRequest) {
  const Served served;
  EXPECT_EQ(served.ask(std::string("\0\0\0\4\xff\xff\xff\xff\r\n\r\n", 12)), "");
  EXPECT_EQ(served.ask("GET /metrics HTTP/1.1\r\nX: " + std::string(20'000, 'x') + "\r\n\r\n"), "");
}

// Before: nine idle connections made 49 of 49 scrapes fail.
TEST(MetricsEndpoint, TheSilentLockNobodyOut) {
  const Served served;
  std::vector<base::UniqueFd> silent;
  for (int i = 0; i < 9; ++i) silent.push_back(served.connect());
  for (int i = 1; i <= 49; ++i) {
    EXPECT_THAT(served.ask("GET /metrics HTTP/1.1\r\nHost: localhost:9100\r\n\r\n"),
                EndsWith("asked " + std::to_string(i) + "\n"));
  }
  EXPECT_EQ(Served::rest(silent.front()), "");  // the oldest has lost its place
}

TEST(MetricsEndpoint, NamesAPortThatIsTaken) {
  boost::asio::io_context io;
  const Endpoint one(io, {}, [] { return ""; });
  try {
    const Endpoint other(io, {"127.0.0.1", one.port()}, [] { return ""; });
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), AllOf(HasSubstr("cannot serve metrics on 127.0.0.1 port "),
                                HasSubstr("choose another metrics.port")));
  }
}

}  // namespace
}  // namespace dtact::metrics
