#include "daemon/serve/encoded_frame.hpp"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>

#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace dtact::net {
namespace {

using google::protobuf::io::CodedOutputStream;

// Wire types of the protobuf encoding.
constexpr std::uint32_t kVarint = 0;
constexpr std::uint32_t kBytes = 2;  // length-delimited

constexpr std::uint32_t tag(int field, std::uint32_t wire_type) {
  return static_cast<std::uint32_t>(field) * 8 + wire_type;
}

}  // namespace

FrameEnvelope::FrameEnvelope(std::size_t body_size, std::uint64_t dropped) noexcept {
  constexpr auto kDropped = tag(v1::Frame::kDroppedFieldNumber, kVarint);
  constexpr auto kFrame = tag(v1::ServerMessage::kFrameFieldNumber, kBytes);
  static_assert(kDropped < 128 && kFrame < 128, "the tags are one byte each");
  if (dropped != 0) {
    tail[0] = kDropped;
    const auto* end = CodedOutputStream::WriteVarint64ToArray(dropped, tail.data() + 1);
    tail_size = static_cast<std::size_t>(end - tail.data());
  }
  std::uint8_t* const message = head.data() + wire::kLengthSize;
  message[0] = kFrame;
  const auto* end = CodedOutputStream::WriteVarint64ToArray(body_size + tail_size, message + 1);
  head_size = static_cast<std::size_t>(end - head.data());
  const auto length = wire::encode_length(head_size - wire::kLengthSize + body_size + tail_size);
  std::copy(length.begin(), length.end(), head.begin());
}

}  // namespace dtact::net
