#include "daemon/net/frame_encoder.hpp"

#include <google/protobuf/io/coded_stream.h>

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/net/depth_maps.hpp"
#include "daemon/net/messages.hpp"
#include "hal/base/clock.hpp"
#include "proto/dtact.pb.h"
#include "proto/framing.hpp"

namespace dtact::net {
namespace {

using google::protobuf::io::CodedOutputStream;

constexpr std::uint32_t kBytes = 2;  // length-delimited

/// A tag of the protobuf encoding.
constexpr std::uint32_t tag(int field, std::uint32_t wire_type) {
  return static_cast<std::uint32_t>(field) * 8 + wire_type;
}

// Buffers that no client holds and that are kept: two of each kind in flight are the usual. More of
// them were slow clients', and their memory goes when those have left.
constexpr std::size_t kSpareBuffers = 3;
// Room for an envelope, the times, and the tags and lengths of the maps.
constexpr std::size_t kMaxBody = wire::kMaxMessage - 256;

void append_varint(std::uint64_t value, std::string& out) {
  std::array<std::uint8_t, 10> bytes;  // NOLINT(cppcoreguidelines-pro-type-member-init)
  const auto* end = CodedOutputStream::WriteVarint64ToArray(value, bytes.data());
  out.append(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::size_t>(end - bytes.data()));
}

/// A message field that begins with `head` and ends with the bytes field `field` of it: protobuf
/// would copy the bytes twice.
void append_message(int number, std::string_view head, int field, std::string_view bytes,
                    std::string& out) {
  const auto last = tag(field, kBytes);
  append_varint(tag(number, kBytes), out);
  append_varint(head.size() + CodedOutputStream::VarintSize32(last) +
                    CodedOutputStream::VarintSize64(bytes.size()) + bytes.size(),
                out);
  out.append(head);
  append_varint(last, out);
  append_varint(bytes.size(), out);
  out.append(bytes);
}

std::string_view text_of(const std::vector<std::uint8_t>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

}  // namespace

struct FrameEncoder::Impl {
  std::string frame_id;
  const pipeline::DepthFrame* frame = nullptr;
  std::optional<std::uint64_t> calibration;
  DepthMaps maps;
  v1::Frame message;
  std::string head;
  std::vector<std::pair<FrameKind, std::shared_ptr<const EncodedFrame>>> done;
  std::vector<std::shared_ptr<EncodedFrame>> buffers;

  std::shared_ptr<EncodedFrame> free_buffer();
  bool write(const FrameKind& kind, std::string& body);
  void append_luma(int encoding, std::string& body);
  void append_jpeg(std::string& body);
  void append_times(std::int64_t encode_ns, std::string& body) const;
};

/// A buffer that no client holds any more. One thread owns them all, so use_count() is exact.
std::shared_ptr<EncodedFrame> FrameEncoder::Impl::free_buffer() {
  std::shared_ptr<EncodedFrame> found;
  std::size_t spare = 0;
  std::erase_if(buffers, [&](const auto& buffer) {
    if (buffer.use_count() > 1) return false;
    if (found != nullptr) return ++spare > kSpareBuffers;
    found = buffer;
    return false;
  });
  if (found == nullptr) {
    found = std::make_shared<EncodedFrame>();
    buffers.push_back(found);
  }
  return found;
}

/// All but the times. False when it is too large.
bool FrameEncoder::Impl::write(const FrameKind& kind, std::string& body) {
  message.Clear();
  fill(*frame, message);
  message.set_frame_id(frame_id);
  if (calibration) message.set_calibration(*calibration);
  const DepthMaps::Map* depth = nullptr;
  if (kind.depth != v1::DEPTH_NONE && frame->has_depth) {
    depth = maps.get(kind.depth, kind.spec, kind.contact_box);
  }
  const bool luma = kind.luma != v1::LUMA_NONE && frame->has_luma;
  const bool jpeg = kind.jpeg && frame->has_jpeg;
  std::size_t size = message.ByteSizeLong();
  if (depth != nullptr) size += depth->head.size() + depth->data.size();
  if (luma) size += frame->luma.size();
  if (jpeg) size += frame->jpeg.size();
  if (size > kMaxBody) return false;
  // All of it at once: a string that grows piece by piece takes up to twice the memory.
  constexpr std::size_t kHeadsAndTimes = 256;
  body.clear();
  body.reserve(size + kHeadsAndTimes);
  message.AppendToString(&body);
  if (depth != nullptr) {
    append_message(v1::Frame::kDepthFieldNumber, depth->head, v1::DepthMap::kDataFieldNumber,
                   depth->data, body);
  }
  if (luma) append_luma(kind.luma, body);
  if (jpeg) append_jpeg(body);
  return true;
}

void FrameEncoder::Impl::append_luma(int encoding, std::string& body) {
  v1::LumaMap luma;
  luma.set_encoding(static_cast<v1::LumaEncoding>(encoding));
  luma.set_width(static_cast<std::uint32_t>(frame->luma_width));
  luma.set_height(static_cast<std::uint32_t>(frame->luma_height));
  luma.SerializeToString(&head);
  append_message(v1::Frame::kLumaFieldNumber, head, v1::LumaMap::kDataFieldNumber,
                 text_of(frame->luma), body);
}

void FrameEncoder::Impl::append_jpeg(std::string& body) {
  v1::JpegImage jpeg;
  jpeg.set_width(static_cast<std::uint32_t>(frame->jpeg_width));
  jpeg.set_height(static_cast<std::uint32_t>(frame->jpeg_height));
  jpeg.SerializeToString(&head);
  append_message(v1::Frame::kJpegFieldNumber, head, v1::JpegImage::kDataFieldNumber,
                 text_of(frame->jpeg), body);
}

void FrameEncoder::Impl::append_times(std::int64_t encode_ns, std::string& body) const {
  v1::StageTimes times;
  fill(frame->times, encode_ns, times);
  append_varint(tag(v1::Frame::kTimesFieldNumber, kBytes), body);
  append_varint(times.ByteSizeLong(), body);
  times.AppendToString(&body);
}

FrameEncoder::FrameEncoder(std::string frame_id) : impl_(std::make_unique<Impl>()) {
  impl_->frame_id = std::move(frame_id);
}
FrameEncoder::~FrameEncoder() = default;

void FrameEncoder::begin(const pipeline::DepthFrame& frame,
                         std::optional<std::uint64_t> calibration) {
  impl_->frame = &frame;
  impl_->calibration = calibration;
  impl_->maps.begin(frame);
  impl_->done.clear();
}

void FrameEncoder::forget() noexcept { impl_->maps.forget(); }

std::shared_ptr<const EncodedFrame> FrameEncoder::encode(const FrameKind& kind) {
  for (const auto& [asked, encoded] : impl_->done) {
    if (asked == kind) return encoded;
  }
  const std::int64_t start_ns = base::system_clock().monotonic_ns();
  auto buffer = impl_->free_buffer();
  if (!impl_->write(kind, buffer->body)) {
    impl_->done.emplace_back(kind, nullptr);
    return nullptr;
  }
  const std::int64_t took_ns = base::system_clock().monotonic_ns() - start_ns;
  impl_->append_times(took_ns, buffer->body);
  times_.add(took_ns);
  impl_->done.emplace_back(kind, buffer);
  return buffer;
}

}  // namespace dtact::net
