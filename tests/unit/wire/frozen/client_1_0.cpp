// A client of version 1.0: client_1_0 PORT. Prints what it was told, a line each; a test compares.
#include <arpa/inet.h>
#include <netinet/in.h>

#include <utility>

#include "tests/unit/wire/frozen/stream_1_0.hpp"

namespace dtact::frozen {
namespace {

base::UniqueFd connect_to(int port) {
  base::UniqueFd fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    Stream::fail("cannot connect");
  }
  return fd;
}

class Client {
 public:
  explicit Client(int port) : stream_(connect_to(port)) {}

  v1::ServerMessage next() {
    v1::ServerMessage message;
    if (!stream_.receive(message)) Stream::fail("the daemon ended the connection");
    return message;
  }
  v1::Reply ask(v1::ClientMessage message) {
    message.set_id(++id_);
    stream_.send(message);
    for (;;) {
      const auto answer = next();
      if (!answer.has_reply()) continue;
      if (answer.reply().id() != id_) Stream::fail("an answer to another request");
      return answer.reply();
    }
  }
  v1::Frame frame() {
    for (;;) {
      auto message = next();
      if (message.has_frame()) return std::move(*message.mutable_frame());
    }
  }
  v1::Event event() {
    for (;;) {
      auto message = next();
      if (message.has_event()) return std::move(*message.mutable_event());
    }
  }

 private:
  Stream stream_;
  std::uint64_t id_ = 0;
};

void print(const v1::Frame& frame) {
  std::printf("frame %llu: %s, health %d, light %u, touching %d, %.2f mm, encoded %d\n",
              static_cast<unsigned long long>(frame.sequence()), frame.frame_id().c_str(),
              frame.health_size(), frame.light().brightness(), frame.contact().touching(),
              frame.contact().deepest_mm(), frame.times().encode_ns() > 0);
  if (frame.has_depth()) {
    const auto& depth = frame.depth();
    std::printf("depth %d: %ux%u, %.3f mm, %.0f um, %zu bytes\n", depth.encoding(), depth.width(),
                depth.height(), depth.mm_per_px(), depth.um_per_unit(), depth.data().size());
  }
  if (frame.has_luma()) {
    std::printf("luma %ux%u, %zu bytes\n", frame.luma().width(), frame.luma().height(),
                frame.luma().data().size());
  }
}

void talk(int port) {
  Client client(port);
  v1::ClientMessage message;
  message.mutable_hello()->set_major(1);
  message.mutable_hello()->set_program("of 1.0");
  const auto hello = client.ask(message).hello();
  std::printf("hello %u: %s, %s\n", hello.major(), hello.program().c_str(),
              hello.surface_frame().frame_id().c_str());
  message.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  message.mutable_subscribe()->set_luma(v1::LUMA_GREY8);
  std::printf("subscribed %d\n", client.ask(message).has_done());
  print(client.frame());
  message.mutable_subscribe()->set_summary(true);
  std::printf("summary %d\n", client.ask(message).has_done());
  print(client.frame());
  const auto event = client.event();
  std::printf("event %d: touching %d\n", event.what_case(), event.contact().contact().touching());
  message.mutable_set_light()->set_brightness(100);
  std::printf("light %u\n", client.ask(message).light().brightness());
  message.mutable_rezero();
  std::printf("rezero %d\n", client.ask(message).has_done());
  message.mutable_get_status();
  const auto status = client.ask(message).status();
  std::printf("status: camera %s, %d client, %s\n", status.camera().identity().c_str(),
              status.clients_size(), status.clients(0).program().c_str());
  message.mutable_list_calibrations();
  std::printf("calibrations %d\n", client.ask(message).calibrations().calibrations_size());
}

}  // namespace
}  // namespace dtact::frozen

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  dtact::frozen::talk(std::atoi(argv[1]));
  return 0;
}
