#include "daemon/net/frame_encoder.hpp"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>
#include <limits>

#include "daemon/net/messages.hpp"
#include "daemon/recon/model.hpp"
#include "hal/base/clock.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace dtact::net {
namespace {

using google::protobuf::io::CodedOutputStream;

// Tags of the protobuf encoding: field number × 8 + wire type (0 varint, 2 length-delimited).
constexpr std::uint8_t kServerMessageFrame = v1::ServerMessage::kFrameFieldNumber * 8 + 2;
constexpr std::uint8_t kFrameDropped = v1::Frame::kDroppedFieldNumber * 8 + 0;
constexpr std::uint8_t kFrameTimes = v1::Frame::kTimesFieldNumber * 8 + 2;
constexpr std::uint8_t kTimesEncode = v1::StageTimes::kEncodeNsFieldNumber * 8 + 0;
static_assert(kFrameDropped < 128 && kFrameTimes < 128, "the tags are one byte each");

// Two client buffers of each kind in flight are the usual; more only costs memory.
constexpr std::size_t kKeptBuffers = 16;
// Room for an envelope.
constexpr std::size_t kMaxBody = wire::kMaxMessage - 64;

void append_encode_time(std::int64_t ns, std::string& body) {
  const auto time = static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(ns, 0, std::numeric_limits<std::uint32_t>::max()));
  std::array<std::uint8_t, 8> field{kFrameTimes, 0, kTimesEncode};
  const auto* end = CodedOutputStream::WriteVarint32ToArray(time, field.data() + 3);
  const auto size = static_cast<std::size_t>(end - field.data());
  field[1] = static_cast<std::uint8_t>(size - 2);
  body.append(reinterpret_cast<const char*>(field.data()), size);
}

}  // namespace

FrameEnvelope::FrameEnvelope(std::size_t body_size, std::uint64_t dropped) noexcept {
  if (dropped != 0) {
    tail[0] = kFrameDropped;
    const auto* end = CodedOutputStream::WriteVarint64ToArray(dropped, tail.data() + 1);
    tail_size = static_cast<std::size_t>(end - tail.data());
  }
  std::uint8_t* const message = head.data() + wire::kLengthSize;
  message[0] = kServerMessageFrame;
  const auto* end = CodedOutputStream::WriteVarint64ToArray(body_size + tail_size, message + 1);
  head_size = static_cast<std::size_t>(end - head.data());
  const auto length = wire::encode_length(head_size - wire::kLengthSize + body_size + tail_size);
  std::copy(length.begin(), length.end(), head.begin());
}

struct FrameEncoder::Impl {
  std::string frame_id;
  const pipeline::DepthFrame* frame = nullptr;
  wire::DeltaZstdEncoder delta_zstd;
  v1::Frame message;
  std::array<std::array<std::shared_ptr<const EncodedFrame>, 2>, 3> done;
  std::vector<std::shared_ptr<EncodedFrame>> buffers;

  std::shared_ptr<EncodedFrame> free_buffer();
  void add_depth(v1::DepthEncoding encoding);
  void add_luma();
};

/// A buffer that no client holds any more. One thread owns them all, so use_count() is exact.
std::shared_ptr<EncodedFrame> FrameEncoder::Impl::free_buffer() {
  for (const auto& buffer : buffers) {
    if (buffer.use_count() == 1) return buffer;
  }
  auto buffer = std::make_shared<EncodedFrame>();
  if (buffers.size() < kKeptBuffers) buffers.push_back(buffer);
  return buffer;
}

void FrameEncoder::Impl::add_depth(v1::DepthEncoding encoding) {
  auto& depth = *message.mutable_depth();
  depth.set_encoding(encoding);
  depth.set_width(static_cast<std::uint32_t>(frame->width));
  depth.set_height(static_cast<std::uint32_t>(frame->height));
  depth.set_mm_per_px(frame->mm_per_px);
  depth.set_um_per_unit(1);
  depth.set_decimation(static_cast<std::uint32_t>(frame->decimation));
  depth.set_uncertainty_um(frame->uncertainty_um);
  depth.set_untrusted_value(recon::kUntrusted);
  if (encoding == v1::DEPTH_DELTA_ZSTD) {
    delta_zstd.encode(frame->depth_um, static_cast<std::size_t>(frame->width),
                      *depth.mutable_data());
  } else {
    wire::encode_int16(frame->depth_um, *depth.mutable_data());
  }
}

void FrameEncoder::Impl::add_luma() {
  auto& luma = *message.mutable_luma();
  luma.set_encoding(v1::LUMA_GREY8);
  luma.set_width(static_cast<std::uint32_t>(frame->luma_width));
  luma.set_height(static_cast<std::uint32_t>(frame->luma_height));
  luma.mutable_data()->assign(reinterpret_cast<const char*>(frame->luma.data()),
                              frame->luma.size());
}

FrameEncoder::FrameEncoder(std::string frame_id) : impl_(std::make_unique<Impl>()) {
  impl_->frame_id = std::move(frame_id);
}
FrameEncoder::~FrameEncoder() = default;

void FrameEncoder::begin(const pipeline::DepthFrame& frame) noexcept {
  impl_->frame = &frame;
  impl_->done = {};
}

std::shared_ptr<const EncodedFrame> FrameEncoder::encode(FrameKind kind) {
  auto& done =
      impl_->done.at(static_cast<std::size_t>(kind.depth)).at(static_cast<std::size_t>(kind.luma));
  if (done != nullptr) return done;
  const std::int64_t start_ns = base::system_clock().monotonic_ns();
  const auto& frame = *impl_->frame;
  auto& message = impl_->message;
  message.Clear();
  fill(frame, message);
  message.set_frame_id(impl_->frame_id);
  if (kind.depth != 0 && frame.has_depth)
    impl_->add_depth(static_cast<v1::DepthEncoding>(kind.depth));
  if (kind.luma != 0 && frame.has_luma) impl_->add_luma();
  if (message.ByteSizeLong() > kMaxBody) return nullptr;
  auto buffer = impl_->free_buffer();
  message.SerializeToString(&buffer->body);
  const std::int64_t took_ns = base::system_clock().monotonic_ns() - start_ns;
  append_encode_time(took_ns, buffer->body);
  times_.add(took_ns);
  done = std::move(buffer);
  return done;
}

}  // namespace dtact::net
