#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "daemon/net/depth_view.hpp"
#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/histogram.hpp"

namespace dtact::net {

/// What a frame message is to hold. Nothing at all: a summary.
struct FrameKind {
  int depth = 0;  ///< dtact.v1.DepthEncoding; 0: none, and the next two say nothing.
  DepthSpec spec = {};
  bool contact_box = false;  ///< The region is where the contact is.
  int luma = 0;              ///< dtact.v1.LumaEncoding
  bool jpeg = false;
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

/// Encodes a frame once for each kind that is asked for, and its maps once for each choice among
/// them, whatever else is in the message. `times.encode_ns` is this very encoding's own time:
/// `times` is written last.
class FrameEncoder {
 public:
  explicit FrameEncoder(std::string frame_id);
  ~FrameEncoder();
  FrameEncoder(const FrameEncoder&) = delete;
  FrameEncoder& operator=(const FrameEncoder&) = delete;

  /// Begins another frame, measured by the calibration of this number. `frame` must stay as it is
  /// until the next call.
  void begin(const pipeline::DepthFrame& frame,
             std::optional<std::uint64_t> calibration = std::nullopt);
  /// The frame as `kind`; the same buffer when asked again. Maps the frame does not have are left
  /// out. Null when it would exceed the wire's cap.
  [[nodiscard]] std::shared_ptr<const EncodedFrame> encode(const FrameKind& kind);

  /// What clients want has changed: gives back the memory of maps that nobody may want any more.
  /// Between two frames only.
  void forget() noexcept;

  /// What each encoding took; its count is that of encodings, not of clients.
  [[nodiscard]] const pipeline::Histogram& times() const noexcept { return times_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  pipeline::Histogram times_;
};

}  // namespace dtact::net
