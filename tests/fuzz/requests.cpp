// Bytes that a client may send: each answer is a message, and the next client is served.
// The first byte selects whether the rest is sent unchanged, or as messages after a Hello, each
// after its length (two bytes, little-endian) in the input.
#include <algorithm>

#include "tests/fuzz/fuzz.hpp"
#include "tests/unit/net/raw_client.hpp"
#include "tests/unit/net/rig.hpp"

namespace dtact::fuzz {
namespace {

using net::test::RawClient;

std::string framed(std::string_view body) {
  const auto length = wire::encode_length(body.size());
  std::string bytes(reinterpret_cast<const char*>(length.data()), length.size());
  return bytes.append(body);
}

std::string stream_of(std::string_view input) {
  if (input.empty() || input.front() == 0) return std::string(input.substr(input.empty() ? 0 : 1));
  input.remove_prefix(1);
  v1::ClientMessage hello;
  hello.set_id(1);
  hello.mutable_hello()->set_major(1);
  std::string stream = framed(hello.SerializeAsString());
  while (input.size() >= 2) {
    const std::size_t length = static_cast<unsigned char>(input[0]) +
                               std::size_t{256} * static_cast<unsigned char>(input[1]);
    stream += framed(input.substr(2, length));
    input.remove_prefix(std::min(input.size(), 2 + length));
  }
  return stream;
}

// NOLINTBEGIN(misc-const-correctness): clang-tidy 19 takes clients that send for constants
void serve(std::string_view input) {
  net::test::Rig rig({}, net::test::answer_done);
  RawClient client(rig.tcp_port());
  client.send_bytes(stream_of(input));
  rig.port.publish(net::test::make_frame(1));
  client.finish();
  while (const auto message = client.receive()) {  // throws unless it is a message
    if (!message->has_reply() || !message->reply().has_error()) continue;
    require(message->reply().error().code() != v1::ERROR_NONE, "an error has a code");
    require_sentence(message->reply().error().message());
  }
  RawClient next(rig.tcp_port());
  next.hello();  // throws unless it is answered
}
// NOLINTEND(misc-const-correctness)

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  dtact::fuzz::serve({reinterpret_cast<const char*>(data), size});
  return 0;
}
