// What a daemon may send, read by the client library: it becomes the library's types or a
// ProtocolError.
#include "clients/cpp/convert.hpp"
#include "clients/cpp/errors.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"
#include "tests/fuzz/fuzz.hpp"

namespace dtact::fuzz {
namespace {

void read(const v1::Frame& message) {
  const client::Frame frame = client::to_frame(message);
  if (!frame.depth) return;
  const auto pixels =
      static_cast<std::size_t>(frame.depth->width) * static_cast<std::size_t>(frame.depth->height);
  require(frame.depth->values.size() == pixels && frame.depth->millimetres().size() == pixels,
          "a depth map has as many values as pixels");
  // What was decoded can be encoded, and comes back.
  wire::DeltaZstdEncoder encoder;
  std::string bytes;
  encoder.encode(frame.depth->values, static_cast<std::size_t>(frame.depth->width), bytes);
  std::vector<std::int16_t> again;
  require(
      wire::decode_delta_zstd(bytes, message.depth().width(), message.depth().height(), again) &&
          again == frame.depth->values,
      "a depth map survives its encoding");
}

}  // namespace
}  // namespace dtact::fuzz

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace dtact;
  v1::ServerMessage message;
  if (!message.ParseFromArray(data, static_cast<int>(size))) return 0;
  try {
    if (message.has_frame()) fuzz::read(message.frame());
    if (message.has_event()) (void)client::to_event(message.event());
    (void)client::to_light(message.reply().light());
    (void)client::to_status(message.reply().status());
    for (const auto& stored : message.reply().calibrations().calibrations()) {
      (void)client::to_stored(stored);
    }
  } catch (const client::ProtocolError& e) {
    fuzz::require_sentence(e.what());
  }
  return 0;
}
