#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/histogram.hpp"

namespace dtact::net {

/// What a frame message is to hold; the values are the wire's DepthEncoding and LumaEncoding. Both
/// 0: a summary.
struct FrameKind {
  int depth = 0;  ///< 0 … 2
  int luma = 0;   ///< 0 … 1
  bool operator==(const FrameKind&) const = default;
};

/// One frame message as every client gets it, but for the client's own drop count.
struct EncodedFrame {
  std::string body;  ///< dtact.v1.Frame without `dropped`.
};

/// What stands around a shared body for one client: before it the length and ServerMessage's
/// frame tag, after it the field `dropped`. Fields of one message may come in any order, so a body
/// can be continued without being parsed or copied.
struct FrameEnvelope {
  FrameEnvelope(std::size_t body_size, std::uint64_t dropped) noexcept;

  std::array<std::uint8_t, 16> head{};
  std::size_t head_size = 0;
  std::array<std::uint8_t, 12> tail{};
  std::size_t tail_size = 0;
};

/// Encodes a frame once for each kind that is asked for. `times.encode_ns` is this very encoding's
/// own time: it is measured around the serialisation and appended to the body as a second `times`,
/// which parsers merge with the first.
class FrameEncoder {
 public:
  explicit FrameEncoder(std::string frame_id);
  ~FrameEncoder();
  FrameEncoder(const FrameEncoder&) = delete;
  FrameEncoder& operator=(const FrameEncoder&) = delete;

  /// Begins another frame. `frame` must stay as it is until the next call.
  void begin(const pipeline::DepthFrame& frame) noexcept;
  /// The frame as `kind`; the same buffer when asked again. Maps the frame does not have are left
  /// out. Null when it would exceed the wire's cap.
  [[nodiscard]] std::shared_ptr<const EncodedFrame> encode(FrameKind kind);

  /// What each encoding took; its count is that of encodings, not of clients.
  [[nodiscard]] const pipeline::Histogram& times() const noexcept { return times_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  pipeline::Histogram times_;
};

}  // namespace dtact::net
