// A daemon of version 1.0, as far as its wire goes: prints its port, serves one client and ends.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <unistd.h>

#include "tests/unit/wire/frozen/stream_1_0.hpp"

namespace dtact::frozen {
namespace {

void refuse(v1::Reply& reply, v1::ErrorCode code, const char* sentence) {
  reply.mutable_error()->set_code(code);
  reply.mutable_error()->set_message(sentence);
}

void answer(const v1::ClientMessage& message, v1::Reply& reply) {
  switch (message.request_case()) {
    case v1::ClientMessage::kHello:
      reply.mutable_hello()->set_major(1);
      reply.mutable_hello()->set_program("dtactd 0.1.0");
      break;
    case v1::ClientMessage::kSubscribe:
      if (!v1::DepthEncoding_IsValid(message.subscribe().depth())) {
        return refuse(reply, v1::ERROR_INVALID, "subscribe: depth encoding is unknown");
      }
      reply.mutable_done();
      break;
    case v1::ClientMessage::kGetStatus:
      reply.mutable_status()->set_state(v1::STATE_SERVING);
      break;
    default:
      reply.mutable_done();
      break;
  }
}

/// False: the connection ends.
bool serve(const v1::ClientMessage& message, Stream& stream) {
  v1::ServerMessage reply;
  reply.mutable_reply()->set_id(message.id());
  const bool known = message.request_case() != v1::ClientMessage::REQUEST_NOT_SET;
  if (known) {
    answer(message, *reply.mutable_reply());
  } else {
    refuse(*reply.mutable_reply(), v1::ERROR_BAD_MESSAGE,
           "the message has no request that this daemon knows: set one, or update dtactd");
  }
  stream.send(reply);
  if (message.has_subscribe() && !reply.reply().has_error()) {
    v1::ServerMessage frame;
    frame.mutable_frame()->set_sequence(7);
    frame.mutable_frame()->mutable_contact()->set_touching(true);
    auto& depth = *frame.mutable_frame()->mutable_depth();
    depth.set_encoding(v1::DEPTH_INT16);
    depth.set_width(2);
    depth.set_height(1);
    depth.set_mm_per_px(0.5);
    depth.set_um_per_unit(1);
    depth.set_untrusted_value(-32768);
    depth.set_data(std::string("\x05\0\0\x80", 4));
    stream.send(frame);
    v1::ServerMessage event;
    event.mutable_event()->mutable_calibration()->set_name("ball");
    stream.send(event);
  }
  return known;
}

void listen() {
  const base::UniqueFd listener(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const any = reinterpret_cast<sockaddr*>(&address);
  if (::bind(listener.get(), any, size) != 0 || ::listen(listener.get(), 4) != 0 ||
      ::getsockname(listener.get(), any, &size) != 0) {
    Stream::fail("cannot listen");
  }
  std::printf("%d\n", ntohs(address.sin_port));
  std::fflush(stdout);
  Stream stream(base::UniqueFd(::accept4(listener.get(), nullptr, nullptr, SOCK_CLOEXEC)));
  v1::ClientMessage message;
  while (stream.receive(message) && serve(message, stream)) {
  }
}

}  // namespace
}  // namespace dtact::frozen

int main() {
  ::alarm(120);  // in case that no client comes
  dtact::frozen::listen();
}
