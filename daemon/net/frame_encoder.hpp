#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "daemon/pipeline/depth_frame.hpp"
#include "daemon/pipeline/histogram.hpp"
#include "daemon/serve/encoded_frame.hpp"
#include "daemon/serve/frame_kind.hpp"

namespace dtact::net {

/// Encodes a frame once for each requested kind, and its maps once for each choice among
/// them, whatever else is in the message. `times.encode_ns` is the time of this encoding itself:
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

  /// The clients' subscriptions have changed: frees memory of maps that may no longer be needed.
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
