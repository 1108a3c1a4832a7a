// Messages that a daemon may send, read by the client library: pixels, or a ProtocolError.
#include <string>

#include "clients/cpp/errors.hpp"
#include "clients/cpp/maps.hpp"
#include "clients/cpp/names.hpp"
#include "proto/depth_encoding.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

void read(const v1::DepthMap& map) {
  const std::vector<std::int16_t> values = client::values_of(map);
  const auto pixels = std::size_t{map.width()} * map.height();
  require(values.size() == pixels && client::millimetres_of(map).size() == pixels,
          "a depth map has as many values as pixels");
  // A decoded map can be encoded, and comes back.
  wire::DepthEncoder encoder;
  std::string bytes;
  encoder.encode(map.encoding(), values, map.width(), bytes);
  std::vector<std::int16_t> again;
  require(wire::decode_depth(map.encoding(), bytes, map.width(), map.height(), again) &&
              again == values,
          "a depth map survives its encoding");
}

template <typename Message>
void read_names(const Message& message) {
  (void)client::names_of(message.health());
  (void)client::name_of(message.state());
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  v1::ServerMessage message;
  if (!message.ParseFromArray(data, static_cast<int>(size))) return 0;
  try {
    (void)client::names_of(message.frame().health());
    fuzz::read_names(message.event().state());
    fuzz::read_names(message.reply().status());
    if (message.frame().has_luma()) (void)client::pixels_of(message.frame().luma());
    if (message.frame().has_depth()) fuzz::read(message.frame().depth());
  } catch (const client::ProtocolError& e) {
    fuzz::require_sentence(e.what());
  }
  return 0;
}
