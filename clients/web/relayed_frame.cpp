#include "clients/web/relayed_frame.hpp"

#include <google/protobuf/io/coded_stream.h>

#include <utility>
#include <vector>

#include "proto/dtact.pb.h"

namespace dtact::web {
namespace {

using google::protobuf::io::CodedInputStream;

// Wire types of protobuf.
constexpr std::uint32_t kVarint = 0;
constexpr std::uint32_t kFixed64 = 1;
constexpr std::uint32_t kBytes = 2;  // length-delimited
constexpr std::uint32_t kFixed32 = 5;

constexpr std::uint32_t tag(int field, std::uint32_t wire_type) {
  return static_cast<std::uint32_t>(field) * 8 + wire_type;
}

constexpr bool is_part(std::uint32_t field) {
  return field == v1::Frame::kDepthFieldNumber || field == v1::Frame::kLumaFieldNumber ||
         field == v1::Frame::kJpegFieldNumber || field == v1::Frame::kCloudFieldNumber ||
         field == v1::Frame::kPoseFieldNumber || field == v1::Frame::kRecognitionFieldNumber;
}

CodedInputStream reader(std::string_view bytes) {
  return CodedInputStream(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                          static_cast<int>(bytes.size()));
}

/// The Frame in a ServerMessage that holds nothing else.
std::optional<std::string_view> frame_of(std::string_view message) {
  CodedInputStream in = reader(message);
  std::uint32_t size = 0;
  if (in.ReadTag() != tag(v1::ServerMessage::kFrameFieldNumber, kBytes)) return std::nullopt;
  if (!in.ReadVarint32(&size)) return std::nullopt;
  const std::string_view rest = message.substr(static_cast<std::size_t>(in.CurrentPosition()));
  if (rest.size() != size) return std::nullopt;
  return rest;
}

/// Passes over a field's value. False where the bytes end before it does.
bool skip(CodedInputStream& in, std::uint32_t wire_type) {
  std::uint64_t number = 0;
  std::uint32_t size = 0;
  switch (wire_type) {
    case kVarint:
      return in.ReadVarint64(&number);
    case kFixed64:
      return in.Skip(8);
    case kBytes:
      return in.ReadVarint32(&size) && in.Skip(static_cast<int>(size));
    case kFixed32:
      return in.Skip(4);
    default:
      return false;
  }
}

}  // namespace

std::optional<RelayedFrame> relay(std::string_view message) {
  const auto frame = frame_of(message);
  if (!frame) return std::nullopt;
  RelayedFrame made;
  auto encoded = std::make_shared<net::EncodedFrame>();
  encoded->body.reserve(frame->size());
  CodedInputStream in = reader(*frame);
  std::size_t kept = 0;  // up to here it is in the body, or left out
  const auto position = [&in] { return static_cast<std::size_t>(in.CurrentPosition()); };
  for (;;) {
    const std::size_t start = position();
    const std::uint32_t next = in.ReadTag();
    if (next == 0) break;
    if (next == tag(v1::Frame::kDroppedFieldNumber, kVarint)) {
      encoded->body += frame->substr(kept, start - kept);
      if (!in.ReadVarint64(&made.dropped)) return std::nullopt;
      kept = position();
    } else if (next == tag(v1::Frame::kMonotonicNsFieldNumber, kVarint)) {
      std::uint64_t zigzag = 0;
      if (!in.ReadVarint64(&zigzag)) return std::nullopt;
      made.monotonic_ns =
          static_cast<std::int64_t>(zigzag >> 1U) ^ -static_cast<std::int64_t>(zigzag & 1U);
    } else {
      const std::uint32_t field = next >> 3U;
      if (is_part(field)) made.parts |= 1U << field;
      if (!skip(in, next & 7U)) return std::nullopt;
    }
  }
  if (position() != frame->size()) return std::nullopt;
  encoded->body += frame->substr(kept);
  made.encoded = std::move(encoded);
  return made;
}

}  // namespace dtact::web
