// The metrics of a daemon as a process.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <csignal>
#include <string>

#include "tests/e2e/sensor.hpp"

namespace dtact::e2e {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

std::string get_metrics(std::uint16_t port) {
  const base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  const sockaddr_in address = loopback(port);
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return "refused";
  }
  const std::string request = "GET /metrics HTTP/1.1\r\nHost: localhost\r\n\r\n";
  EXPECT_EQ(::send(fd.get(), request.data(), request.size(), MSG_NOSIGNAL),
            static_cast<ssize_t>(request.size()));
  std::string answer;
  char buffer[4096];
  for (ssize_t n = 0; (n = ::recv(fd.get(), buffer, sizeof buffer, 0)) > 0;) {
    answer.append(buffer, static_cast<std::size_t>(n));
  }
  return answer;
}

TEST(Metrics, AreServedWhereConfigured) {
  const std::uint16_t port = free_port();
  const Sensor sensor({}, true, {"metrics.port=" + std::to_string(port)});
  client::Client client = sensor.connect();
  client.subscribe();
  ASSERT_TRUE(read_until(client, [](const Item& item) {
    const auto* frame = std::get_if<v1::Frame>(&item);
    return frame != nullptr && frame->has_depth();
  }));
  EXPECT_THAT(
      get_metrics(port),
      AllOf(StartsWith("HTTP/1.1 200 OK\r\n"), HasSubstr("dtactd_state{state=\"serving\"} 1\n"),
            HasSubstr("dtactd_clients 1\n"), HasSubstr("dtactd_reference_age_seconds "),
            HasSubstr("dtactd_camera_state{state=\"streaming\"} 1\n"),
            HasSubstr("dtactd_stage_duration_seconds_bucket{stage=\"encode\",le=\"+Inf\"} "),
            Not(HasSubstr("dtactd_frames_total 0\n"))));
  EXPECT_EQ(sensor.daemon->stop(SIGTERM), 0);
}

TEST(Metrics, AreOffUnlessConfigured) {
  const Sensor sensor({}, false);
  EXPECT_THAT(sensor.daemon->log(), Not(HasSubstr("/metrics")));
}

}  // namespace
}  // namespace dtact::e2e
