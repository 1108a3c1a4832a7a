// Measures latency for ./dev bench: clients of dtactd that stamp each frame when its last
// byte has come out of the socket. Nothing is decoded before the stamp.
//   loop_client --port PORT [--clients N] [--seconds S] [--skip S] [--depth int16|predict_zstd]
//               [--cpu CPU] [--fifo PRIORITY] -o FILE
// FILE: one line a frame and client. Prints whether the system granted pinning and FIFO.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <CLI/CLI.hpp>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/base/clock.hpp"
#include "hal/base/rt_thread.hpp"
#include "hal/base/unique_fd.hpp"
#include "proto/defaults.hpp"
#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace {

namespace v1 = dtact::v1;

struct Arguments {
  std::uint16_t port = dtact::wire::kDefaultPort;
  int clients = 1;
  double seconds = 10;
  double skip = 1;
  std::string depth = "int16";
  std::optional<int> cpu;
  int fifo = 0;
  std::string output;
};

struct Sample {
  std::uint64_t sequence = 0;
  std::int64_t stamp_ns = 0;                                 ///< Frame.monotonic_ns, …
  v1::TimestampMeaning meaning = v1::TIMESTAMP_UNSPECIFIED;  ///< … which is this.
  std::int64_t ready_ns = 0;
  std::int64_t published_ns = 0;
  std::int64_t received_ns = 0;
  std::uint64_t dropped = 0;
  bool in_contact = false;
};

std::int64_t now_ns() { return dtact::base::system_clock().monotonic_ns(); }

/// One connection. Throws std::runtime_error for an unexpected message of the daemon.
class Connection {
 public:
  explicit Connection(std::uint16_t port) : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(fd_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      throw std::runtime_error(fmt::format("nothing listens on port {}", port));
    }
    const int on = 1;
    ::setsockopt(fd_.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    const timeval limit{10, 0};  // so that a daemon that died does not hang the benchmark
    ::setsockopt(fd_.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  }

  void request(v1::ClientMessage message) {
    message.set_id(++id_);
    const auto length = dtact::wire::encode_length(message.ByteSizeLong());
    std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
    message.AppendToString(&bytes);
    if (::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL) !=
        static_cast<ssize_t>(bytes.size())) {
      throw std::runtime_error("the request was not sent");
    }
    for (;;) {
      const v1::ServerMessage& reply = receive();
      if (!reply.has_reply()) continue;
      if (reply.reply().has_error()) throw std::runtime_error(reply.reply().error().message());
      return;
    }
  }
  /// The next message; received_ns() is the arrival of its last byte.
  const v1::ServerMessage& receive() {
    std::uint32_t length = 0;
    read(reinterpret_cast<char*>(&length), sizeof length);
    buffer_.resize(ntohl(length));
    read(buffer_.data(), buffer_.size());
    received_ns_ = now_ns();
    if (!message_.ParseFromArray(buffer_.data(), static_cast<int>(buffer_.size()))) {
      throw std::runtime_error("the daemon sent no ServerMessage");
    }
    return message_;
  }
  [[nodiscard]] std::int64_t received_ns() const { return received_ns_; }

 private:
  void read(char* to, std::size_t size) {
    while (size > 0) {
      const ssize_t n = ::recv(fd_.get(), to, size, MSG_WAITALL);
      if (n <= 0) throw std::runtime_error("the daemon ended the connection or fell silent");
      to += n;
      size -= static_cast<std::size_t>(n);
    }
  }

  dtact::base::UniqueFd fd_;
  std::uint64_t id_ = 0;
  std::string buffer_;
  v1::ServerMessage message_;
  std::int64_t received_ns_ = 0;
};

/// Subscribes, skips the first seconds, then records every frame.
void measure(const Arguments& arguments, std::vector<Sample>& samples) {
  Connection connection(arguments.port);
  v1::ClientMessage hello;
  hello.mutable_hello()->set_major(dtact::wire::kMajor);
  hello.mutable_hello()->set_minor(dtact::wire::kMinor);
  hello.mutable_hello()->set_program("loop_client");
  connection.request(hello);
  v1::ClientMessage subscribe;
  subscribe.mutable_subscribe()->set_depth(arguments.depth == "int16" ? v1::DEPTH_INT16
                                                                      : v1::DEPTH_PREDICT_ZSTD);
  connection.request(subscribe);

  // Reserved before, because the kernel would otherwise provide memory while frames arrive.
  samples.reserve(static_cast<std::size_t>(arguments.seconds * 2000) + 1000);
  const std::int64_t from_ns = now_ns() + static_cast<std::int64_t>(arguments.skip * 1e9);
  const std::int64_t until_ns = from_ns + static_cast<std::int64_t>(arguments.seconds * 1e9);
  while (now_ns() < until_ns) {
    const v1::ServerMessage& message = connection.receive();
    if (!message.has_frame() || connection.received_ns() < from_ns) continue;
    const v1::Frame& frame = message.frame();
    samples.push_back({frame.sequence(), frame.monotonic_ns(), frame.meaning(), frame.ready_ns(),
                       frame.published_ns(), connection.received_ns(), frame.dropped(),
                       frame.contact().in_contact()});
  }
}

void write(const std::string& file, const std::vector<std::vector<Sample>>& clients) {
  std::string text =
      "client,sequence,stamp_ns,meaning,ready_ns,published_ns,received_ns,dropped,in_contact\n";
  for (std::size_t i = 0; i < clients.size(); ++i) {
    for (const Sample& s : clients[i]) {
      fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{},{},{},{}\n", i, s.sequence,
                     s.stamp_ns, static_cast<int>(s.meaning), s.ready_ns, s.published_ns,
                     s.received_ns, s.dropped, s.in_contact ? 1 : 0);
    }
  }
  std::ofstream out(file);
  if (!(out << text).flush()) throw std::runtime_error(file + " cannot be written");
}

void run(const Arguments& arguments) {
  const auto refused_memory = dtact::base::lock_memory();
  std::vector<std::vector<Sample>> samples(static_cast<std::size_t>(arguments.clients));
  std::vector<dtact::base::RtThread> threads;
  threads.reserve(samples.size());
  std::vector<std::string> failures(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    threads.emplace_back(
        dtact::base::RtSettings{
            .name = "loop-client", .cpu = arguments.cpu, .fifo_priority = arguments.fifo},
        [&, i] {
          try {
            measure(arguments, samples[i]);
          } catch (const std::exception& e) {
            failures[i] = e.what();
          }
        });
  }
  for (auto& thread : threads) thread.join();
  for (const std::string& failure : failures) {
    if (!failure.empty()) throw std::runtime_error(failure);
  }
  write(arguments.output, samples);
  if (refused_memory) fmt::print("refused: {}\n", *refused_memory);
  for (const std::string& refused : threads.front().refused()) fmt::print("refused: {}\n", refused);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Arguments arguments;
    CLI::App app("Measures the latency of dtactd's frames.", "loop_client");
    app.add_option("--port", arguments.port, "of the daemon on this machine")->required();
    app.add_option("--clients", arguments.clients, "each a connection and a thread")
        ->check(CLI::Range(1, 1024));
    app.add_option("--seconds", arguments.seconds, "measured")->check(CLI::Range(0.1, 1e5));
    app.add_option("--skip", arguments.skip, "seconds before that")->check(CLI::Range(0.0, 1e3));
    app.add_option("--depth", arguments.depth)->check(CLI::IsMember({"int16", "predict_zstd"}));
    app.add_option("--cpu", arguments.cpu, "to pin the threads to");
    app.add_option("--fifo", arguments.fifo, "SCHED_FIFO priority; 0: normal scheduling")
        ->check(CLI::Range(0, 99));
    app.add_option("-o,--output", arguments.output, "CSV file")->required();
    CLI11_PARSE(app, argc, argv);
    run(arguments);
    return 0;
  } catch (const std::exception& e) {
    fmt::print(stderr, "loop_client: {}\n", e.what());
    return 1;
  }
}
