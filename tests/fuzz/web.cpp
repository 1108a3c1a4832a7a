// dtact-web's input from daemons and from Foxglove's clients: a relayed frame equals the frame
// that was sent, Foxglove's view of it is made or refused, and no text or bytes of a
// client break anything.
#include <stdexcept>

#include "clients/cpp/errors.hpp"
#include "clients/web/foxglove/protocol.hpp"
#include "clients/web/foxglove/topics.hpp"
#include "clients/web/relayed_frame.hpp"
#include "clients/web/token_query.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

void try_relay(const std::string& bytes) {
  const auto relayed = web::relay(bytes);
  v1::ServerMessage message;
  if (!relayed || !message.ParseFromString(bytes)) return;
  v1::Frame got;
  require(got.ParseFromString(relayed->encoded->body), "what is relayed can be read");
  require(message.frame().dropped() == relayed->dropped, "what the gateway missed is counted");
  require(message.frame().monotonic_ns() == relayed->monotonic_ns, "it has its own time");
  message.mutable_frame()->clear_dropped();
  require(got.SerializeAsString() == message.frame().SerializeAsString(),
          "what is relayed is what was sent");
}

void try_topics(const std::string& bytes) {
  using namespace web::foxglove;
  v1::ServerMessage message;
  if (!message.ParseFromString(bytes)) return;
  for (const TopicInfo& info : topics()) {
    try {
      (void)message_of(info.topic, message.frame());
    } catch (const client::ProtocolError& e) {
      require_sentence(e.what());
    }
  }
}

void try_foxglove(const std::string& text) {
  using namespace web::foxglove;
  (void)parse_operation(text);
  (void)web::token_of(text);
  const auto call = parse_call(text);
  for (const Service service : {Service::set_light, Service::rezero}) {
    try {
      (void)request_of(service, call ? call->payload : text);
    } catch (const std::runtime_error&) {
      continue;
    }
  }
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  dtact::fuzz::try_relay(bytes);
  dtact::fuzz::try_topics(bytes);
  dtact::fuzz::try_foxglove(bytes);
  return 0;
}
